"""The ``model-keys`` directive: the keys of a pydantic model and of the models inside it."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

from robotd_doctor.model_tables import model_keys


class ModelKeysDirective(SphinxDirective):
    """Render the model ``module:Class``, one section for each model in it.

    Options: those of ``model_keys``.
    """

    required_arguments = 1
    option_spec = dict.fromkeys(("title", "prefix", "headings"), directives.unchanged)

    def run(self) -> list[nodes.Node]:
        """Return headings and tables."""
        text = model_keys(self.arguments[0], self.options)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def setup(app: Any) -> None:
    """Register the directive."""
    app.add_directive("model-keys", ModelKeysDirective)
