"""Conversions between core types and messages of axes."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

from robotd.device.axes import Jog, Move
from robotd.errors import InvalidArgument, reason_of
from robotd.motion.profile import Profile

NO_AXES = frozenset({-1})
LENGTH = 4  # byte of serialized messages at which the length of their first array is


def axes_of(data: bytes, count: int) -> frozenset[int]:
    """Return the axes of a serialized AxisVelocity or AxisPose, of a device with ``count``.

    ``NO_AXES`` where it is rejected: without an axis, or with a number that is none.
    """
    order = "<" if data[1:2] == b"\x01" else ">"
    try:
        (length,) = struct.unpack_from(f"{order}I", data, LENGTH)
        index = struct.unpack_from(f"{order}{min(length, count)}i", data, LENGTH + 4)
    except struct.error:
        return NO_AXES
    axes = frozenset(index)
    return axes if axes and axes <= frozenset(range(count)) else NO_AXES


def parallel(axes: Sequence[int], **columns: Sequence[float]) -> list[tuple[Any, ...]]:
    """One tuple of values per axis. Raises InvalidArgument for a column of another length."""
    for name, values in columns.items():
        if len(values) != len(axes):
            raise InvalidArgument(f"{name} has {len(values)} values for {len(axes)} axes")
    return [tuple(values[i] for values in columns.values()) for i in range(len(axes))]


def check_flag(axis: int, value: int) -> None:
    """Raise InvalidArgument for a number that stands for neither on (1) nor off (0)."""
    if value not in (0, 1):
        raise InvalidArgument(f"axis {axis}: data {value} is not 0 or 1")


def parameter_lines(axis: int, text: str) -> list[str]:
    """Lines of ``params_dump`` for one axis: a heading, its parameters, an empty line."""
    return [f"=== Axis {axis} ===", *text.splitlines(), ""]


def moves(message: Any) -> list[Move]:
    """The moves of an AxisPose; their numbers are checked where they are executed."""
    rows = parallel(
        message.index,
        target=message.target,
        velocity=message.velocity,
        acc=message.acc,
        dec=message.dec,
    )
    return [
        Move(axis, target, Profile(*profile))
        for axis, (target, *profile) in zip(message.index, rows, strict=True)
    ]


def jogs(message: Any) -> list[Jog]:
    """The velocity commands of an AxisVelocity; numbers are checked where they are executed."""
    rows = parallel(message.index, velocity=message.velocity, acc=message.acc, dec=message.dec)
    return [Jog(axis, Profile(*row)) for axis, row in zip(message.index, rows, strict=True)]


def fill_outcome(
    response: Any,
    names: Sequence[str],
    results: Mapping[int, Exception | None],
    notes: Mapping[int, str] | None = None,
) -> Any:
    """Fill ``success``, true when every axis succeeded, and the outcome of each in ``message``.

    ``notes``: text after the "ok" of an axis.
    """
    notes = notes or {}
    response.success = not any(results.values())
    response.message = "; ".join(
        f"{names[axis]}: {f'ok{notes.get(axis, str())}' if error is None else reason_of(error)}"
        for axis, error in results.items()
    )
    return response
