"""``robotd sim run --from``: recorded commands on the simulation, and the difference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from robotd.api import NANOSECONDS, RecordingError
from robotd.api.commands import ExitCode, columns, escaped, load_robot
from robotd.api.robots import load_backend
from robotd_recording.recording_reader import read_recording
from robotd_scenario.recorded_commands import POSITION, CommandRepeater, Repetition


def repeat_recording(path: Path, robot: str | None) -> ExitCode:
    """Repeat and print the differences; FAILED when one exceeds the goal tolerance.

    Raises RobotdError: the recording cannot be read, or does not fit the robot.
    """
    recording = read_recording(path)
    info = recording.info
    descriptor = load_robot(robot or info.robot, info.variant or None)
    if descriptor.axes != len(info.axes):
        text = f"{path} has {len(info.axes)} axes, {descriptor.name} has {descriptor.axes}"
        raise RecordingError(text)
    try:
        repeater = CommandRepeater(recording, descriptor, load_backend("sim"))
    except ValueError as error:
        raise RecordingError(str(error)) from error
    repetition = repeater.run()
    settings = descriptor.trajectory
    tolerances = {"rad": settings.goal_tolerance_rad, "m": settings.goal_tolerance_m}
    units = {joint.axis: joint.unit for joint in descriptor.joints}
    axes = [(name, units.get(axis, "rad")) for axis, name in enumerate(info.axes)]
    differences = [*compare(repetition, axes, tolerances)]
    for line in columns([HEADING, *map(_row, differences)]):
        click.echo(escaped(line))
    for time_s, text in repetition.rejections:
        click.echo(f"{time_s:9.3f} s  rejected by the simulation: {escaped(text)}")
    seconds = len(repetition.recorded) / info.rate_hz
    count = f"{repetition.commands} command{'s' if repetition.commands != 1 else ''}"
    used = dict.fromkeys(unit for _, unit in axes)
    tolerance = ", ".join(f"{tolerances[unit]:g} {unit}" for unit in used)
    click.echo(f"{count} over {seconds:.1f} s, tolerance {tolerance}")
    beyond = [each for each in differences if each.first_s is not None]
    if not beyond:
        click.echo("the simulation moved as recorded")
        return ExitCode.OK
    first = min(beyond, key=lambda each: each.first_s or 0.0)
    click.echo(
        f"differs from {first.first_s:.3f} s on: {first.name} recorded {first.recorded:+.4f},"
        f" simulated {first.simulated:+.4f} {first.unit}"
    )
    return ExitCode.FAILED


HEADING = ("axis", "largest difference", "at", "beyond the tolerance from")


def _row(each: Difference) -> tuple[str, ...]:
    first = "-" if each.first_s is None else f"{each.first_s:.3f} s"
    return each.name, f"{each.largest:.5f} {each.unit}", f"{each.largest_s:.3f} s", first


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
