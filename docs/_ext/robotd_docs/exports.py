"""The ``exports`` directive: everything that a module exports, grouped by kind. Only in reST."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.domains.python import PyObject
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.util.docutils import SphinxDirective
from sphinx.util.parsing import nested_parse_to_nodes

from robotd_doctor.python_help import exported

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
        module, kind = self.arguments[0], self.options["kind"]
        directive = DIRECTIVES.get(kind, "autoclass")
        lines: list[str] = []
        for name in exported(module, kind, self.options.get("except", "").split()):
            lines += [f".. {directive}:: {module}.{name}"]
            lines += MEMBERS if directive == "autoclass" else []
            lines += ["   :undoc-members:", ""] if kind == "enums" else [""]
        if not lines:
            raise self.error(f"{module} exports no {kind}")
        return nested_parse_to_nodes(self.state, StringList(lines, source=module))


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
