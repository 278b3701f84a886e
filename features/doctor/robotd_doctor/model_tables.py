"""Keys of a pydantic model as Markdown tables, for the site and for ``robotd docs``."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from typing import Any

from pydantic import BaseModel

HEADER = ("key", "value", "default", "meaning")
TYPES = {"array": "list", "object": "mapping", "string": "text"}
BOUNDS = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
LENGTHS = {"minItems": "at least {} items", "maxItems": "at most {} items"}

Schema = dict[str, Any]


def model_keys(place: str, options: Mapping[str, str]) -> str:
    """Return the keys of a model, and of the models inside it, as Markdown.

    Args:
        place: ``module:Class``.
        options: ``title``: heading of the first table; ``prefix``: key path of the model in its
            file, such as ``backends.sim``; ``headings``: Markdown of the headings, ``##`` without.
    """
    module, _, name = place.partition(":")
    model: type[BaseModel] = getattr(import_module(module), name)
    schema = model.model_json_schema()
    sections = [*Tables(schema.get("$defs", {})).of(schema, options.get("prefix", ""))]
    titles = [options["title"], *(f"`{path}`" for path, _ in sections[1:])]
    marks = options.get("headings", "##")
    parts = zip(titles, sections, strict=True)
    return "\n\n".join(f"{marks} {title}\n\n{lines}" for title, (_, lines) in parts)


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table; columns that are empty in every row are left out."""
    lines = [list(row) for row in rows]
    used = [index for index in range(len(header)) if any(line[index] for line in lines)]
    cells = [[line[index].replace("|", "\\|") for index in used] for line in lines]
    head = [header[index] for index in used]
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(used), *cells])


class Tables:
    """Key tables of a JSON schema, depth first.

    Args:
        definitions: the ``$defs`` of the schema.
    """

    def __init__(self, definitions: dict[str, Schema]) -> None:
        self._definitions = definitions
        self._seen: set[str] = set()

    def of(self, schema: Schema, path: str) -> Iterator[tuple[str, str]]:
        """Yield the key path and the table of ``schema``, then those of its sections."""
        required = schema.get("required", ())
        rows, inner = [], []
        for key, field in schema.get("properties", {}).items():
            value, references = self._value(field)
            default = "**required**" if key in required else _default(field, bool(references))
            rows.append((f"`{key}`", value, default, field.get("description", "")))
            suffix = "[]" if _alternatives(field)[0].get("type") == "array" else ""
            several = len(references) > 1
            inner += [
                (name, f"{path}.{key}{suffix}".lstrip(".") + several * f" ({name})")
                for name in references
            ]
        yield path, table(HEADER, rows)
        for name, key_path in inner:
            if name not in self._seen:
                self._seen.add(name)
                yield from self.of(self._definitions[name], key_path)

    def _value(self, field: Schema) -> tuple[str, list[str]]:
        """Return the kind of value in words, and the names of the models that it holds."""
        words, references = [], []
        for item in _alternatives(field):
            of = _inside(item)
            names = (self._reference(item), self._reference(of))
            references += [name for name in names if name and self._is_section(name)]
            words.append(self._words(item, of))
        return " or ".join(dict.fromkeys(words)), references

    def _words(self, item: Schema, of: Schema) -> str:
        if name := self._reference(item):
            return "section" if self._is_section(name) else self._words(self._definitions[name], {})
        if "const" in item:
            return f"`{json.dumps(item['const'])}`"
        if "enum" in item:
            return ", ".join(f"`{value}`" for value in item["enum"])
        kind = str(item.get("type", "any"))
        word = str(item.get("format") or TYPES.get(kind, kind))
        if of:
            word += f" of {self._words(of, {}).replace('section', 'sections')}"
        bounds = [f"{sign} {item[name]:g}" for name, sign in BOUNDS.items() if name in item]
        bounds += [text.format(item[name]) for name, text in LENGTHS.items() if name in item]
        return ", ".join([word, *bounds])

    def _is_section(self, name: str) -> bool:
        return "properties" in self._definitions[name]

    def _reference(self, item: Schema) -> str:
        return str(item.get("$ref", "")).rpartition("/")[2]


def _alternatives(field: Schema) -> list[Schema]:
    return [item for item in _choices(field) if item.get("type") != "null"] or [{}]


def _inside(item: Schema) -> Schema:
    """Return the schema of the items of a list, or of the values of a mapping; {} without one."""
    inside = item.get("items", item.get("additionalProperties", {}))
    if not isinstance(inside, dict) or not inside:  # of a mapping whose keys have a pattern
        inside = next(iter(item.get("patternProperties", {}).values()), {})
    return _alternatives(inside)[0] if inside else {}


def _choices(field: Schema) -> list[Schema]:
    """Return the members of a union, of unions inside it too; another field alone."""
    members = field.get("anyOf") or field.get("oneOf")
    return (
        [item for union_member in members for item in _choices(union_member)]
        if members
        else [field]
    )


def _default(field: Schema, holds_models: bool) -> str:
    default = field.get("default", ...)
    if default is ...:
        return "computed"
    if isinstance(default, dict) and holds_models:
        return "its defaults"
    if default in ("", [], {}):
        return "empty"
    return f"`{json.dumps(default, ensure_ascii=False)}`".replace('"', "")
