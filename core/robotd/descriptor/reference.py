"""The key tables of the robots' README, made from the models: ``python -m`` this module."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

from robotd.descriptor.model import RobotDescriptor

BEGIN, END = "<!-- keys: begin -->", "<!-- keys: end -->"

_BOUNDS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
_EXTENDS = {
    "type": "string",
    "format": "path",
    "default": None,
    "description": "Another robot.yaml, relative to this file, over which this one is laid.",
}


def key_tables() -> str:
    """Markdown: one table for the top level and one for each section."""
    schema = RobotDescriptor.model_json_schema()
    schema["properties"]["extends"] = _EXTENDS
    tables = ["\n".join(_table("Top level", schema))]
    for key, field in schema["properties"].items():
        section = _section(field)
        if section:
            title = f"`{key}[]`" if "items" in field else f"`{key}`"
            tables.append("\n".join(_table(title, schema["$defs"][section])))
    return "\n\n".join(tables)


def _table(title: str, schema: dict[str, Any]) -> Iterator[str]:
    yield f"### {title}\n"
    yield "| key | value | default | meaning |"
    yield "|---|---|---|---|"
    for key, field in schema["properties"].items():
        default = "**required**" if key in schema.get("required", ()) else _default(field)
        yield f"| `{key}` | {_value(field)} | {default} | {field['description']} |"


def _section(field: dict[str, Any]) -> str | None:
    """Name of the model that a field holds, or holds a list of."""
    inner = _not_null(field.get("items", field))
    reference: str | None = inner.get("$ref")
    return reference and reference.rpartition("/")[2]


def _value(field: dict[str, Any]) -> str:
    if _section(field):
        return "list, see below" if "items" in field else "section, see below"
    inner = _not_null(field)
    if "const" in inner:
        return str(inner["const"])
    words = {"array": "list of names", "object": "mapping", "string": "text"}
    word = words.get(inner["type"], inner["type"])
    bounds = [f"{sign} {inner[name]:g}" for name, sign in _BOUNDS.items() if name in inner]
    return ", ".join([inner.get("format", word), *bounds])


def _default(field: dict[str, Any]) -> str:
    default = field.get("default", ...)
    if default is ...:
        return "computed"
    if default is None:
        return "null"
    if isinstance(default, dict) and _section(field):
        return "its defaults"
    return "empty" if default in ("", [], {}) else f"{default}"


def _not_null(field: dict[str, Any]) -> dict[str, Any]:
    return next((item for item in field.get("anyOf", ()) if item.get("type") != "null"), field)


if __name__ == "__main__":
    sys.stdout.write(f"{BEGIN}\n{key_tables()}\n{END}\n")
