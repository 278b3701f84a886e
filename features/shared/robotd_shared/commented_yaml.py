"""YAML that is changed and keeps its comments, order and quotes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

MAX_LINE = 10_000  # flow mappings stay on their line


def commented_yaml() -> YAML:
    """Return a reader and writer of YAML that keeps what a person has written."""
    yaml = YAML()
    yaml.width, yaml.preserve_quotes = MAX_LINE, True
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.representer.add_representer(
        type(None), lambda dumper, _: dumper.represent_scalar("tag:yaml.org,2002:null", "null")
    )
    return yaml


def on_one_line(value: Any) -> Any:
    """Return ``value`` for YAML; a mapping on one line."""
    if not isinstance(value, Mapping):
        return value
    mapping = CommentedMap(value)
    mapping.fa.set_flow_style()
    return mapping
