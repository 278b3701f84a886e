"""The ``exports`` directive: everything that a module exports, grouped by kind. Only in reST."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from enum import Enum
from importlib import import_module
from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.domains.python import PyObject
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.util.docutils import SphinxDirective
from sphinx.util.parsing import nested_parse_to_nodes


def is_class(value: Any, base: type = object) -> bool:
    """Return True for a class below ``base``."""
    return inspect.isclass(value) and issubclass(value, base)


def is_driver(value: Any) -> bool:
    """Return True for a class that a backend implements."""
    return is_class(value) and (value.__name__.endswith("Driver") or inspect.isabstract(value))


KINDS: dict[str, Callable[[Any], bool]] = {  # the first that matches decides
    "exceptions": lambda value: is_class(value, Exception),
    "drivers": is_driver,
    "enums": lambda value: is_class(value, Enum),
    "classes": is_class,
    "functions": inspect.isfunction,
    "data": lambda value: True,
}
DIRECTIVES = {"exceptions": "autoexception", "functions": "autofunction", "data": "autodata"}
MEMBERS = ["   :members:", "   :exclude-members: model_config"]


class ExportsDirective(SphinxDirective):
    """Render the names in ``__all__`` of a module that are of one kind.

    Options:
        kind: one of ``KINDS``.
        except: names that are described elsewhere.
    """

    required_arguments = 1
    option_spec = {"kind": directives.unchanged_required, "except": directives.unchanged}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        """Return the descriptions, in the order of ``__all__``."""
        module = import_module(self.arguments[0])
        wanted, skipped = self.options["kind"], self.options.get("except", "").split()
        lines: list[str] = []
        for name in module.__all__:
            value = getattr(module, name)
            kind = next(kind for kind, matches in KINDS.items() if matches(value))
            if kind == wanted and name not in skipped:
                directive = DIRECTIVES.get(kind, "autoclass")
                lines += [f".. {directive}:: {module.__name__}.{name}"]
                lines += MEMBERS if directive == "autoclass" else []
                lines += ["   :undoc-members:", ""] if kind == "enums" else [""]
        if not lines:
            raise self.error(f"{module.__name__} exports no {wanted}")
        return nested_parse_to_nodes(self.state, StringList(lines, source=module.__name__))


def _whole(docstring: Any) -> list[str]:
    return [*docstring._consume_to_end()]  # noqa: SLF001 - there is no setting for it


def setup(app: Any) -> None:
    """Register the directive, and name the attributes of a class so."""
    # Napoleon reads "Time in s; 0: none" of a property as type and text.
    GoogleDocstring._parse_attribute_docstring = _whole  # noqa: SLF001
    for fields in PyObject.doc_field_types:
        if fields.name == "variable":
            fields.label = "Attributes"
    app.add_directive("exports", ExportsDirective)
