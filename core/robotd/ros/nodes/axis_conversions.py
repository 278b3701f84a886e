"""Conversions between core types and messages of axes."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from robotd.device.axes import Jog, Move
from robotd.errors import InvalidArgument, reason_of
from robotd.motion.profile import Profile


def axis_numbers(index: Iterable[int], count: int) -> list[int]:
    """The axes of a request: at least one, each in 0..count-1, none twice."""
    axes = list(index)
    if not axes:
        raise InvalidArgument("no axis given")
    for axis in axes:
        if not 0 <= axis < count:
            raise InvalidArgument(f"axis {axis} is outside 0..{count - 1}")
        if axes.count(axis) > 1:
            raise InvalidArgument(f"axis {axis} is given twice")
    return axes


def parallel(axes: Sequence[int], **columns: Sequence[float]) -> list[tuple[Any, ...]]:
    """One tuple of values per axis; refuses columns that are not as long as ``axes``."""
    for name, values in columns.items():
        if len(values) != len(axes):
            raise InvalidArgument(f"{name} has {len(values)} values for {len(axes)} axes")
    return list(zip(*columns.values(), strict=True))


def choices(axes: Sequence[int], data: Sequence[int], allowed: Collection[int]) -> dict[int, int]:
    """The value of ``data`` for each axis; refuses one that is not among ``allowed``."""
    values = {axis: value for axis, (value,) in zip(axes, parallel(axes, data=data), strict=True)}
    for axis, value in values.items():
        if value not in allowed:
            words = " or ".join(str(each) for each in allowed)
            raise InvalidArgument(f"axis {axis}: data {value} is not {words}")
    return values


def gear_ratios(message: Any, count: int) -> dict[int, tuple[float, float]]:
    """Axis → (numerator, denominator), both positive and finite, of a SetAxisGearRatio request."""
    axes = axis_numbers(message.index, count)
    rows = parallel(axes, numerator=message.numerator, denominator=message.denominator)
    for axis, row in zip(axes, rows, strict=True):
        for part, value in zip(("numerator", "denominator"), row, strict=True):
            if not (math.isfinite(value) and value > 0.0):
                raise InvalidArgument(
                    f"axis {axis}: gear ratio {part} {value:g} is not positive and finite"
                )
    return dict(zip(axes, rows, strict=True))


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
        Move(axis, target, Profile(velocity, acceleration, deceleration))
        for axis, (target, velocity, acceleration, deceleration) in zip(
            message.index, rows, strict=True
        )
    ]


def jogs(message: Any) -> list[Jog]:
    """The velocity commands of an AxisVelocity; numbers are checked where they are executed."""
    rows = parallel(message.index, velocity=message.velocity, acc=message.acc, dec=message.dec)
    return [Jog(axis, Profile(*row)) for axis, row in zip(message.index, rows, strict=True)]


def fill_outcome(
    response: Any, names: Sequence[str], results: Mapping[int, Exception | None]
) -> Any:
    """``success`` when every axis succeeded, and what happened to each in ``message``."""
    response.success = not any(results.values())
    response.message = "; ".join(
        f"{names[axis]}: {'ok' if error is None else reason_of(error)}"
        for axis, error in results.items()
    )
    return response
