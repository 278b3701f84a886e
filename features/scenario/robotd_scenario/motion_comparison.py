"""Comparison of recorded and simulated motion, joint by joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robotd.api import NANOSECONDS
from robotd_scenario.recorded_commands import POSITION, Repetition


@dataclass(frozen=True)
class Difference:
    """Difference of one axis.

    Attributes:
        name, unit: of the axis; rad or m.
        largest: largest difference of the measured position.
        largest_s: its time from the start of the comparison, seconds.
        first_s: time at which the tolerance was exceeded first; None: never.
        recorded, simulated: positions at that time, else at the time of the largest difference.
    """

    name: str
    unit: str
    largest: float
    largest_s: float
    first_s: float | None
    recorded: float
    simulated: float


def compare(
    repetition: Repetition, axes: Sequence[tuple[str, str]], tolerances: Mapping[str, float]
) -> Iterator[Difference]:
    """Yield the difference of each axis.

    Args:
        repetition: recorded and simulated motion.
        axes: name and unit of each.
        tolerances: of each unit.
    """
    recorded = repetition.recorded["values"][:, POSITION]
    simulated = repetition.simulated["values"][:, POSITION]
    starts = repetition.recorded["start_ns"]
    times_s = (starts - starts[0]) / NANOSECONDS
    errors = np.nan_to_num(np.abs(recorded - simulated))
    for axis, (name, unit) in enumerate(axes):
        worst = int(np.argmax(errors[:, axis]))
        beyond = np.flatnonzero(errors[:, axis] > tolerances[unit])
        shown = int(beyond[0]) if len(beyond) else worst
        yield Difference(
            name,
            unit,
            float(errors[worst, axis]),
            float(times_s[worst]),
            float(times_s[shown]) if len(beyond) else None,
            float(recorded[shown, axis]),
            float(simulated[shown, axis]),
        )
