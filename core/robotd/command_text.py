"""Text of commands for the event log: names of axes and arguments instead of code."""

from __future__ import annotations

from collections.abc import Iterator, Sequence


def command_text(
    command: str, parameters: Sequence[str], values: Sequence[object], axes: Sequence[str]
) -> str:
    """Return ``set output bit: byte 0, bit 3, value on``, or ``servo: joint6, on``.

    Args:
        command: name of the method.
        parameters: names of its arguments.
        values: of the arguments that were given, in order.
        axes: names of the axes; empty where the command has none.
    """
    arguments = [
        text
        for parameter, value in zip(parameters, values, strict=False)
        for text in _argument(parameter, value, axes)
    ]
    name = command.replace("_", " ")
    return f"{name}: {', '.join(arguments)}" if arguments else name


def _argument(parameter: str, value: object, axes: Sequence[str]) -> Iterator[str]:
    """Yield the text of one argument, or of each axis in it."""
    if isinstance(value, (list, tuple, range)):
        for part in value:
            yield from _argument(parameter, part, axes)
    elif parameter in ("axis", "axes"):
        yield _axis(value, axes)
    elif hasattr(value, "target"):
        yield f"{_axis(value.axis, axes)} to {value.target:+.4f}"  # type: ignore[attr-defined]
    elif hasattr(value, "profile"):
        yield f"{_axis(value.axis, axes)} at {value.profile.velocity:+.4f}/s"  # type: ignore[attr-defined]
    elif parameter in ("on", "joint"):
        yield _text(value)
    elif value is not None:
        yield f"{parameter} {_text(value)}"


def _axis(axis: object, names: Sequence[str]) -> str:
    return names[axis] if isinstance(axis, int) and 0 <= axis < len(names) else f"axis {axis}"


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, bytes):
        return f"0x{value.hex()}"
    return f"{value:g}" if isinstance(value, float) else str(value)
