"""YAML loader that keeps file and line of every value.

A strict subset of YAML: one document, string keys, no tags, no aliases, no duplicate keys, and
the plain scalars of JSON (so ``yes`` is a string and ``1e-3`` a number). All errors are reported
at once, each with its line. Size, depth and count are limited, so that no file takes long.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robotd.descriptor.files import read_limited
from robotd.errors import DescriptorError

MAX_BYTES = 1_000_000
MAX_DEPTH = 20
MAX_VALUES = 10_000  # 1000 points of a trajectory of 6 joints are 8000
MAX_KEY = 100  # characters
MAX_TEXT = 4096  # characters; the longest path that Linux takes
_TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|nan)")


@dataclass(frozen=True, slots=True)
class YamlNode:
    """A value of a YAML tree.

    Attributes:
        value: a scalar, a dict of nodes or a list of nodes.
        path: the file that it comes from, or ``--set`` for a value of the command line.
        line: 1-based; for the value of a key, the line of the key; None outside a file.
    """

    value: Any
    path: Path
    line: int | None

    def plain(self) -> Any:
        """Return the value without its origin: nested scalars, dicts and lists."""
        if isinstance(self.value, dict):
            return {key: child.plain() for key, child in self.value.items()}
        if isinstance(self.value, list):
            return [child.plain() for child in self.value]
        return self.value

    def find(self, keys: Sequence[str | int]) -> YamlNode:
        """Return the node at ``keys``, or its deepest existing ancestor."""
        node = self
        for key in keys:
            children = node.value
            if isinstance(children, list):
                children = dict(enumerate(children))
            if not isinstance(children, dict) or key not in children:
                break
            node = children[key]
        return node


def read_yaml(path: Path) -> YamlNode:
    """Read a file whose top level is a mapping. Raises DescriptorError."""
    data = read_limited(path, MAX_BYTES)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DescriptorError(f"not UTF-8 text ({error.reason})", path=path, line=line) from None
    return parse_yaml(text, path)


def parse_yaml(text: str, path: Path) -> YamlNode:
    """Read the text of a file whose top level is a mapping.

    ``path``: of the file, for errors; it is not opened. Raises DescriptorError.
    """
    if len(text) > MAX_BYTES:
        raise DescriptorError(f"longer than {MAX_BYTES:_} characters", path=path)
    root = _build(text, path)
    if not isinstance(root.value, dict):
        raise DescriptorError("must be a mapping of keys to values", path=path, line=1)
    return root


def read_value(text: str, origin: Path) -> YamlNode:
    """Read one value, without lines, in the syntax of a file: scalar, list or mapping.

    Raises DescriptorError for text that is not YAML, with ``origin`` as the file.
    """
    return _build(text, origin, has_lines=False)


def _build(text: str, path: Path, *, has_lines: bool = True) -> YamlNode:
    builder = _Builder(path, has_lines=has_lines)
    try:
        root = builder.document(iter(yaml.parse(text, Loader=_LOADER)))
    except yaml.YAMLError as error:
        raise _syntax_error(text, error, path) from None
    if builder.problems:
        raise DescriptorError.join(builder.problems)
    return root


def _syntax_error(text: str, error: Any, path: Path) -> DescriptorError:
    """Return the error of a text that is not YAML, with its line."""
    what = getattr(error, "problem", None) or getattr(error, "reason", None) or "unreadable"
    # libyaml from 0.2.6 looks 1000 brackets ahead, before the first of them is an event here.
    if "nesting depth" in what:
        return DescriptorError(_TOO_DEEP, path=path, line=error.problem_mark.line + 1)
    mark, start = getattr(error, "problem_mark", None), getattr(error, "context_mark", None)
    # Without a mark it is a character that no text has, by its byte.
    line = 1 + (mark.line if mark else text.encode().count(b"\n", 0, error.position))
    if any(
        text_line.lstrip(" ").startswith("\t") for text_line in text.splitlines()[line - 1 : line]
    ):
        what = "the line is indented by a tab: use spaces"
    elif start is not None and start.line + 1 != line:  # such as the quote that is not closed
        what += f", {error.context} from line {start.line + 1}"
    return DescriptorError(f"not valid YAML: {what}", path=path, line=line)


class _Builder:
    """Builds nodes from parser events; collects recoverable errors, raises the others."""

    def __init__(self, path: Path, *, has_lines: bool) -> None:
        self._path, self._has_lines = path, has_lines
        self._values = 0
        self.problems: list[DescriptorError] = []

    def document(self, events: Iterator[Any]) -> YamlNode:
        root: YamlNode | None = None
        event: Any
        for event in events:
            if not isinstance(event, yaml.NodeEvent):
                continue  # starts and ends of streams and documents
            if root is not None:
                raise self._error("a second document; one file describes one robot", event)
            root = self._node(event, events, _line(event), depth=0)
        return root or YamlNode(None, self._path, 1)

    def _node(self, event: Any, events: Iterator[Any], line: int, depth: int) -> YamlNode:
        if depth > MAX_DEPTH:
            raise self._error(_TOO_DEEP, event)
        self._values += 1
        if self._values > MAX_VALUES:
            raise self._error(f"more than {MAX_VALUES:_} values", event)
        if isinstance(event, yaml.AliasEvent):
            self._refuse(f"alias *{event.anchor}: use variants or extends instead", event)
            return YamlNode(None, self._path, line)
        if event.tag is not None:
            self._refuse(f"tag {event.tag!r} is not allowed", event)
        value: Any
        if isinstance(event, yaml.MappingStartEvent):
            value = self._mapping(events, depth)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self._sequence(events, depth)
        else:
            value = self._scalar(event)
        return YamlNode(value, self._path, line if self._has_lines else None)

    def _mapping(self, events: Iterator[Any], depth: int) -> dict[str, YamlNode]:
        children: dict[str, YamlNode] = {}
        key: Any
        for key in events:
            if isinstance(key, yaml.MappingEndEvent):
                break
            if not isinstance(key, yaml.ScalarEvent):
                raise self._error("a key must be a word", key)
            if len(key.value) > MAX_KEY:
                raise self._error(f"a key is longer than {MAX_KEY} characters", key)
            line = _line(key)
            child = self._node(next(events), events, line, depth + 1)
            if key.value in children:
                first = children[key.value].line
                self._refuse(f"key {key.value!r} was given before, on line {first}", key)
            children[key.value] = child
        return children

    def _sequence(self, events: Iterator[Any], depth: int) -> list[YamlNode]:
        children: list[YamlNode] = []
        for event in events:
            if isinstance(event, yaml.SequenceEndEvent):
                break
            children.append(self._node(event, events, _line(event), depth + 1))
        return children

    def _scalar(self, event: Any) -> bool | int | float | str | None:
        text: str = event.value
        if len(text) > MAX_TEXT:
            raise self._error(f"a text is longer than {MAX_TEXT} characters", event)
        return _plain_scalar(text) if event.implicit[0] else text

    def _error(self, message: str, event: Any) -> DescriptorError:
        return DescriptorError(message, path=self._path, line=_line(event))

    def _refuse(self, message: str, event: Any) -> None:
        self.problems.append(self._error(message, event))


def _plain_scalar(text: str) -> bool | int | float | str | None:
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _NUMBER.fullmatch(text):
        return float(text.replace(".inf", "inf").replace(".nan", "nan"))
    return text


def _line(event: Any) -> int:
    line: int = event.start_mark.line
    return line + 1
