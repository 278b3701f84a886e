"""The ``pytest-fixtures`` directive: the fixtures of a module, with scope and docstring."""

from __future__ import annotations

import inspect
from importlib import import_module
from typing import Any

from _pytest.fixtures import FixtureFunctionDefinition
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.ext.napoleon import Config, GoogleDocstring
from sphinx.util.docutils import SphinxDirective
from sphinx.util.parsing import nested_parse_to_nodes


class FixturesDirective(SphinxDirective):
    """Render every fixture that a module defines, in the order of its source. Only in reST."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return a description of each fixture."""
        module = import_module(self.arguments[0])
        lines: list[str] = []
        for name, value in vars(module).items():
            if isinstance(value, FixtureFunctionDefinition):
                lines += self._fixture(name, value)
        if not lines:
            raise self.error(f"{module.__name__} defines no fixture")
        return nested_parse_to_nodes(self.state, StringList(lines, source=module.__name__))

    def _fixture(self, name: str, fixture: FixtureFunctionDefinition) -> list[str]:
        marker = fixture._fixture_function_marker  # noqa: SLF001 - pytest has no public name
        text = inspect.getdoc(fixture._get_wrapped_function()) or ""  # noqa: SLF001
        doc = str(GoogleDocstring(text, Config(napoleon_use_rtype=False))).splitlines()
        head = [f".. py:data:: {name}", "   :no-index:", f"   :type: {marker.scope} fixture", ""]
        return [*head, *(f"   {line}" for line in doc), ""]


def setup(app: Any) -> None:
    """Register the directive."""
    app.add_directive("pytest-fixtures", FixturesDirective)
