"""``robotd sim run --from``: recorded commands on the simulation, and the difference."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from robotd.api import NANOSECONDS, Profile, RecordingError, RobotdError, RobotDescriptor
from robotd.api.commands import ExitCode, columns, escaped, load_robot
from robotd.api.features import (
    FLAGS,
    VALUES,
    EventKind,
    FrameRing,
    Frames,
    IoSampler,
    period_writer,
)
from robotd.api.robots import (
    Backend,
    Jog,
    Move,
    Robot,
    SteppedClock,
    TrajectoryExecution,
    TrajectoryRequest,
    load_backend,
)
from robotd_recording.recording_reader import Recording, read_recording

MEMORY_BYTES = 2**31  # of the simulated frames
MARGIN_S = 5.0  # simulated beyond the recording at most: commands that wait
POSITION = VALUES.index("position")  # row of the frames' values
SERVO_ON = FLAGS.index("servo_on")  # row of the frames' flags


@dataclass(frozen=True)
class Repetition:
    """Result of a repetition.

    Attributes:
        recorded, simulated: frames of the same moments, one for each recorded period.
        commands: number of commands and goals.
        rejections: time in seconds and text of each command that the simulation rejected.
    """

    recorded: Frames
    simulated: Frames
    commands: int
    rejections: tuple[tuple[float, str], ...]


@dataclass(frozen=True)
class _Command:
    """Command of a recording: its time from the first frame, name and arguments."""

    time_ns: int
    name: str
    data: Mapping[str, Any]


class CommandRepeater:
    """Runs the commands of a recording on a simulation, faster than real time. One thread.

    The simulation begins with all servos on, at the positions of the first period in which the
    recorded robot was ready with its servos on. Its inputs have the recorded levels, so that those
    that guard the robot do as they did.

    Args:
        recording: of a robot with joints; goals, moves, jogs, stops, servo, alarm and output
            commands are repeated.
        descriptor: of the same robot.
        backend: simulated.

    Raises ValueError: the robot was never ready in the recording.
    """

    def __init__(self, recording: Recording, descriptor: RobotDescriptor, backend: Backend) -> None:
        self._frames = _from_ready(recording)
        self._first_ns = int(self._frames["start_ns"][0])
        self._commands = sorted(
            (command for command in _commands(recording) if command.time_ns >= self._first_ns),
            key=lambda event: event.time_ns,
        )
        self._robot = Robot(_at(descriptor, self._frames[0]), backend, SteppedClock())
        self._inputs = sorted(recording.inputs)
        self._shown = b""  # of the inputs
        self._goals: list[tuple[TrajectoryExecution, ExitStack]] = []
        self._rejections: list[tuple[float, str]] = []

    def run(self) -> Repetition:
        """Repeat the commands at their times."""
        robot = self._robot
        duration_s = float(self._frames["start_ns"][-1] - self._first_ns) / NANOSECONDS
        rate_hz = robot.descriptor.cycle.rate_hz
        ring = FrameRing(robot.image.axes, rate_hz, duration_s + MARGIN_S, MEMORY_BYTES)
        self._show_inputs(self._first_ns)
        robot.start()
        io = IoSampler(robot.io, robot.clock.now_ns)
        robot.control_loop.observe(period_writer(robot, ring, io))
        began_ns = robot.clock.now_ns()
        changes = [time_ns for time_ns, _ in self._inputs if time_ns > self._first_ns]
        actions = [(change, partial(self._show_inputs, change)) for change in changes]
        actions += [
            (command.time_ns, partial(self._execute, command)) for command in self._commands
        ]
        for time_ns, act in sorted(actions, key=lambda action: action[0]):
            self._step_until(began_ns + time_ns - self._first_ns)
            act()
        self._step_until(began_ns + round(duration_s * NANOSECONDS))
        for _, context in self._goals:
            context.close()
        simulated = ring.since(0)[0]
        robot.shutdown()
        # By time: the recorded control loop may have missed periods, the simulated one has not.
        passed_s = (self._frames["start_ns"] - self._first_ns) / NANOSECONDS
        periods = np.rint(passed_s * rate_hz).astype(np.int64)
        there = periods < len(simulated)
        return Repetition(
            self._frames[there],
            simulated[periods[there]],
            len(self._commands),
            tuple(self._rejections),
        )

    def _step_until(self, time_ns: int) -> None:
        """Let time pass; release goals that have ended."""
        robot = self._robot
        while robot.clock.now_ns() < time_ns:
            robot.step(1)
            for goal in [goal for goal in self._goals if goal[0].completion.done]:
                self._goals.remove(goal)
                goal[1].close()

    def _show_inputs(self, time_ns: int) -> None:
        """Set the inputs of the simulation to their recorded levels at a time."""
        shown = next((data for at_ns, data in reversed(self._inputs) if at_ns <= time_ns), b"")
        for byte, level in enumerate(shown):
            before = self._shown[byte] if byte < len(self._shown) else 0
            for bit in range(8):
                if (before ^ level) >> bit & 1:
                    self._robot.fault_injector.set_input_bit(byte, bit, bool(level >> bit & 1))
        self._shown = shown

    def _execute(self, command: _Command) -> None:
        try:
            if command.name == "goal":
                self._start_goal(command.data)
            else:
                _CALLS[command.name](self._robot, *_arguments(command.data))
        except RobotdError as error:
            time_s = (command.time_ns - self._first_ns) / NANOSECONDS
            self._rejections.append((time_s, f"{command.name}: {error}"))

    def _start_goal(self, data: Mapping[str, Any]) -> None:
        request = TrajectoryRequest(
            tuple(data["joints"]),
            data["times_s"],
            data["positions"],
            data.get("velocities"),
            data.get("accelerations"),
        )
        context = ExitStack()
        follower = self._robot.groups.of(request.joint_names).follower
        execution = context.enter_context(follower.follow(request))
        self._goals.append((execution, context))


def _from_ready(recording: Recording) -> Frames:
    """Return the frames, two at least, from the first with all joints ready and servos on."""
    frames, joints = recording.frames, list(recording.info.joints)
    servo_on = frames["flags"][:, SERVO_ON][:, joints].all(axis=1)
    ready = np.flatnonzero((servo_on & (frames["ready"] == 1))[:-1])
    if len(ready) == 0:
        raise ValueError(f"{recording.path}: the robot was never ready with its servos on")
    return frames[ready[0] :]


def _at(descriptor: RobotDescriptor, frame: Any) -> RobotDescriptor:
    """Return the descriptor with the positions of ``frame`` as those of the simulation."""
    positions = np.nan_to_num(frame["values"][POSITION]).tolist()
    options = {**descriptor.backends.get("sim", {}), "initial_position_rad": positions}
    return descriptor.model_copy(update={"backends": {**descriptor.backends, "sim": options}})


def _commands(recording: Recording) -> Iterator[_Command]:
    for time_ns, data in recording.goals:
        yield _Command(time_ns, "goal", data)
    for event in recording.events:
        is_accepted = event.data.get("outcome") == "accepted"
        name = str(event.data.get("call", ""))
        if event.kind is EventKind.COMMAND and is_accepted and name in _CALLS:
            yield _Command(event.time_ns, name, event.data)


def _arguments(data: Mapping[str, Any]) -> Sequence[Any]:
    return [*data["args"], *data.get("options", {}).values()]


def _moves(robot: Robot, moves: Sequence[Mapping[str, Any]], relative: bool = False) -> None:
    targets = [Move(move["axis"], move["target"], Profile(**move["profile"])) for move in moves]
    robot.axes.move(targets, relative=relative)


def _jogs(robot: Robot, jogs: Sequence[Mapping[str, Any]]) -> None:
    robot.axes.jog([Jog(jog["axis"], Profile(**jog["profile"])) for jog in jogs])


_CALLS: dict[str, Callable[..., None]] = {
    "move": _moves,
    "jog": _jogs,
    "servo": lambda robot, *args: robot.axes.servo(*args),
    "clear_alarm": lambda robot, *args: robot.axes.clear_alarm(*args),
    "set_command_mode": lambda robot, *args: robot.axes.set_command_mode(*args),
    "stop": lambda robot, *args: robot.axes.stop(*args),
    "quick_stop": lambda robot, *args: robot.axes.quick_stop(*args),
    "set_output_bit": lambda robot, *args: robot.io.set_output_bit(*args),
}


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
    beyond = [difference for difference in differences if difference.first_s is not None]
    if not beyond:
        click.echo("the simulation moved as recorded")
        return ExitCode.OK
    first = min(beyond, key=lambda difference: difference.first_s or 0.0)
    click.echo(
        f"differs from {first.first_s:.3f} s on: {first.name} recorded {first.recorded:+.4f},"
        f" simulated {first.simulated:+.4f} {first.unit}"
    )
    return ExitCode.FAILED


HEADING = ("axis", "largest difference", "at", "beyond the tolerance from")


def _row(difference: Difference) -> tuple[str, ...]:
    first = "-" if difference.first_s is None else f"{difference.first_s:.3f} s"
    return (
        difference.name,
        f"{difference.largest:.5f} {difference.unit}",
        f"{difference.largest_s:.3f} s",
        first,
    )


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
