"""Outline of a program: a row for each step, as the page lists it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from robotd_teach.program_code import Keys, Program, one_line, shown, text_of
from robotd_teach.program_edit import POSED
from robotd_teach.program_file import Step


def outline(program: Program) -> list[dict[str, Any]]:
    """Return the rows of a program in the order of its file.

    Each has ``text``, ``depth``, ``line`` (null where it has none) and ``keys``, those of its
    place in the file (empty where it is a heading, or a segment of a sequence: ``part``); a step
    also ``key`` as in ``ProgramState``, ``kind``, ``numbers`` (values by key that can be edited,
    null where the file has none),
    ``posed`` (its target can be the present pose), and whether there are steps before and after it.
    """
    file = program.file
    rows = [*_rows(program, file.steps, ("steps",), 0)]
    for name, steps in file.blocks.items():
        rows.append(_heading(program, f"block {name}", ("blocks", name), 0))
        rows += _rows(program, steps, ("blocks", name), 1)
    return rows


def _rows(
    program: Program, steps: Sequence[Step], keys: Keys, depth: int
) -> Iterator[dict[str, Any]]:
    for index, step in enumerate(steps):
        place = (*keys, index)
        value = (*place, step.kind)
        yield {
            "text": _text(step),
            "depth": depth,
            "line": program.tree.find(value).line,
            "keys": [*place],
            "key": ".".join(map(str, value)),
            "kind": step.kind,
            "numbers": _numbers(step),
            "posed": step.kind in POSED,
            "before": index > 0,
            "after": index < len(steps) - 1,
        }
        for number, segment in enumerate(step.sequence.segments if step.sequence else ()):
            part = one_line(shown(segment))
            yield _heading(program, part, (*value, "segments", number), depth + 1, is_part=True)
        if step.repeat is not None:
            yield from _rows(program, step.repeat.steps, (*value, "steps"), depth + 1)
        if step.branch is not None:
            yield from _rows(program, step.branch.steps, (*value, "steps"), depth + 1)
            if step.branch.otherwise:
                yield _heading(program, "else", (*value, "else"), depth)
                yield from _rows(program, step.branch.otherwise, (*value, "else"), depth + 1)


def _heading(
    program: Program, text: str, keys: Keys, depth: int, *, is_part: bool = False
) -> dict[str, Any]:
    line = program.tree.find(keys).line
    return {"text": text, "depth": depth, "line": line, "keys": [], "part": is_part}


def _text(step: Step) -> str:
    if step.repeat is not None:
        times = step.repeat.times
        return f"repeat: {times} times" if times else "repeat: without an end"
    if step.branch is not None:
        return f"if: {step.branch.input} is {'on' if step.branch.level else 'off'}"
    if step.sequence is not None:
        return one_line({"sequence": shown(step.sequence, but=frozenset({"segments"}))})
    return f"call: {step.call}" if step.call is not None else text_of(step)


def _numbers(step: Step) -> dict[str, float | None]:
    """Return the numbers of a step that can be edited."""
    value = step.value
    numbers = {"speed": value.speed} if hasattr(value, "speed") else {}
    if step.path is not None and step.path.through is not None:
        numbers["blend_m"] = step.path.blend_m
    if step.sequence is not None:
        numbers["blend_m"] = step.sequence.blend_m or None
    return numbers
