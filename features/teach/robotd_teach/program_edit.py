"""Edits of a program's text that keep every comment and all that they do not mean.

Steps are found by PyYAML's marks, and text is replaced between them. Steps move as whole lines,
with the comments directly above them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from robotd.api import InvalidArgument

TARGETS = ("pose", "joints", "at", "by")
POSED = ("move", "line")  # steps whose target the present pose can replace
DECIMALS = 4

Keys = Sequence[str | int]


def with_number(text: str, keys: Keys, key: str, value: float | None) -> str:
    """Return a program with a number in the mapping at ``keys``; None: without it."""
    mapping = _mapping(_find(text, keys), keys)
    pairs = mapping.value
    index = _index(mapping, key)
    if index is None:
        return text if value is None else _added(text, mapping, f"{key}: {value:g}")
    node = pairs[index][1]
    if value is not None:
        return _replaced(text, node.start_mark.index, node.end_mark.index, f"{value:g}")
    if len(pairs) == 1:
        raise InvalidArgument(f"{_dotted(keys)} has nothing but {key}")
    return _removed(text, mapping, index)


def with_joints(text: str, keys: Keys, joints: Mapping[str, float]) -> str:
    """Return a program in which the target at ``keys`` is the position of joints, rad or m."""
    mapping = _mapping(_find(text, keys), keys)
    found = [index for name in TARGETS if (index := _index(mapping, name)) is not None]
    if not found:
        raise InvalidArgument(f"{_dotted(keys)} has no target")
    start, end = mapping.value[found[0]][0].start_mark, _end(mapping.value[found[0]][1])
    text = _replaced(text, start.index, end.index, f"joints: {_positions(joints)}")
    mapping = _mapping(_find(text, keys), keys)
    frame = _index(mapping, "frame")
    return text if frame is None else _removed(text, mapping, frame)


def with_move_after(text: str, keys: Keys, joints: Mapping[str, float]) -> str:
    """Return a program with a move to the position of joints after the step at ``keys``."""
    lines = text.splitlines(keepends=True)
    steps, index = _steps(text, keys)
    _, end = _block(lines, steps, index)
    lines[end - 1] = lines[end - 1].rstrip("\n") + "\n"
    lines.insert(end, f"{' ' * steps.start_mark.column}- {move_to(joints)}\n")
    return "".join(lines)


def without_step(text: str, keys: Keys) -> str:
    """Return a program without the step at ``keys``."""
    lines = text.splitlines(keepends=True)
    steps, index = _steps(text, keys)
    if len(steps.value) == 1:
        raise InvalidArgument(f"{_dotted(keys)} is the only step there")
    start, end = _block(lines, steps, index)
    return "".join([*lines[:start], *lines[end:]])


def with_step_moved(text: str, keys: Keys, by: int) -> str:
    """Return a program in which the step at ``keys`` has changed places with its neighbour.

    ``by``: -1 with the one before, 1 with the one after it.
    """
    lines = text.splitlines(keepends=True)
    steps, index = _steps(text, keys)
    first = min(index, index + by)
    if not 0 <= first < len(steps.value) - 1:
        raise InvalidArgument(f"{_dotted(keys)} has no step {'before' if by < 0 else 'after'} it")
    lines[-1] = lines[-1].rstrip("\n") + "\n"
    (start, mid), (next_, end) = (_block(lines, steps, place) for place in (first, first + 1))
    swapped = [*lines[next_:end], *lines[mid:next_], *lines[start:mid]]
    return "".join([*lines[:start], *swapped, *lines[end:]])


def move_to(joints: Mapping[str, float]) -> str:
    """Return a step that moves to the position of joints."""
    return f"move: {{joints: {_positions(joints)}}}"


def _positions(joints: Mapping[str, float]) -> str:
    pairs = (f"{name}: {position:z.{DECIMALS}f}" for name, position in joints.items())
    return f"{{{', '.join(pairs)}}}"


def _find(text: str, keys: Keys) -> Any:
    """Return the node at ``keys``. Raises InvalidArgument: there is none."""
    node: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for key in keys:
        if isinstance(node, yaml.SequenceNode) and isinstance(key, int) and key < len(node.value):
            node = node.value[key]
        elif isinstance(node, yaml.MappingNode) and (index := _index(node, str(key))) is not None:
            node = node.value[index][1]
        else:
            raise InvalidArgument(f"the program has no {_dotted(keys)}")
    return node


def _mapping(node: yaml.Node, keys: Keys) -> yaml.MappingNode:
    if not isinstance(node, yaml.MappingNode):
        raise InvalidArgument(f"{_dotted(keys)} has no keys")
    return node


def _index(mapping: yaml.MappingNode, key: str) -> int | None:
    return next((i for i, (name, _) in enumerate(mapping.value) if name.value == key), None)


def _added(text: str, mapping: yaml.MappingNode, pair: str) -> str:
    """Return ``text`` with one more pair in a mapping, at its end or, in a block, its start."""
    if mapping.flow_style:
        end = _end(mapping.value[-1][1]).index if mapping.value else mapping.start_mark.index + 1
        return _replaced(text, end, end, f", {pair}" if mapping.value else pair)
    start = mapping.value[0][0].start_mark
    return _replaced(text, start.index, start.index, f"{pair}\n{' ' * start.column}")


def _removed(text: str, mapping: yaml.MappingNode, index: int) -> str:
    """Return ``text`` without one of several pairs of a mapping."""
    key, value = mapping.value[index]
    if index and not mapping.flow_style:
        lines = text.splitlines(keepends=True)
        return "".join([*lines[: key.start_mark.line], *lines[_end(value).line + 1 :]])
    if index:
        return _replaced(text, _end(mapping.value[index - 1][1]).index, _end(value).index, "")
    return _replaced(text, key.start_mark.index, mapping.value[1][0].start_mark.index, "")


def _replaced(text: str, start: int, end: int, new: str) -> str:
    return text[:start] + new + text[end:]


def _end(node: Any) -> yaml.Mark:
    """Return the end of a node's last character: a block's own mark is after its comments."""
    if isinstance(node, yaml.ScalarNode) or node.flow_style or not node.value:
        mark: yaml.Mark = node.end_mark
        return mark
    last = node.value[-1]
    return _end(last[1] if isinstance(node, yaml.MappingNode) else last)


def _steps(text: str, keys: Keys) -> tuple[yaml.SequenceNode, int]:
    """Return the sequence that a step is in, and its index. Raises InvalidArgument."""
    *parent, index = keys
    _find(text, keys)
    steps = _find(text, parent)
    if not isinstance(steps, yaml.SequenceNode) or steps.flow_style or not isinstance(index, int):
        raise InvalidArgument(f"{_dotted(parent)} is in brackets: edit it in its file")
    return steps, index


def _block(lines: Sequence[str], steps: yaml.SequenceNode, index: int) -> tuple[int, int]:
    """Return the first line of a step with the comments above it, and the line after it."""
    start = steps.value[index].start_mark.line
    if not lines[start].lstrip().startswith("- "):
        raise InvalidArgument(f"line {start + 1} has no '-' of its step: edit it in its file")
    first = _end(steps.value[index - 1]).line + 1 if index else 0
    end = _end(steps.value[index]).line + 1
    while start > first and lines[start - 1].lstrip().startswith("#"):
        start -= 1
    return start, end


def _dotted(keys: Keys) -> str:
    return ".".join(map(str, keys)) or "the program"
