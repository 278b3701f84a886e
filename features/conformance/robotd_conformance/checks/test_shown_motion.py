"""The image of a motion and of its end: operation, completeness and commands, in every read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, FloatArray, Operation, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import jog, ramped

JOG_SHARE, STREAM_SHARE, RAMP_S, STREAM_S = 0.2, 0.2, 0.1, 0.3
SHOWN_PERIODS = 5  # until the image shows the end of a motion in all its values
SPIKE_RAD_S = 0.05  # highest measured speed of an axis at rest
AT_REST_RAD_S = 1e-4  # commanded at most
LOOK_S = 0.1
ENDED_S = 0.5  # granted to a drive to find that it has arrived
IDLE, STREAM = int(Operation.IDLE), int(Operation.STREAM)  # NumPy compares with an int faster
COUNTS, TURN = 2.0**18, 2.0 * np.pi  # of a gear ratio


class Watch:
    """Reads of a check in each control period, and which of them contradict themselves.

    Attributes:
        problems: one line for each axis and contradiction.
    """

    def __init__(self, harness: Harness) -> None:
        self._stage, self._tolerance = "", harness.pose.tolerance
        self._problems: dict[tuple[int, str], str] = {}
        self._targets: FloatArray = np.full(harness.count, np.nan)
        self._idle_reads = np.zeros(harness.count, int)
        self._moved_ns = np.zeros(harness.count, np.int64)
        self._fresh_ns = 0

    @property
    def problems(self) -> list[str]:
        return list(self._problems.values())

    def begin(self, stage: str) -> None:
        """``stage`` is what the axes are commanded next."""
        self._stage = stage
        self._targets = np.full(len(self._idle_reads), np.nan)

    def expect(self, targets: FloatArray) -> None:
        """Moves to ``targets`` (n_axes,) are shown from now on."""
        self._targets = targets

    def __call__(self, image: ProcessImage) -> None:
        if image.fresh_ns == self._fresh_ns:
            return
        if not self._fresh_ns:
            self._moved_ns[:] = image.fresh_ns
        self._fresh_ns = image.fresh_ns
        executing = image.operation != IDLE
        at_rest = np.abs(image.velocity_command) <= AT_REST_RAD_S
        streams = image.operation == STREAM
        self._moved_ns = np.where(executing & at_rest & ~streams, self._moved_ns, image.fresh_ns)
        overdue = image.fresh_ns - self._moved_ns > ENDED_S * 1e9
        self._idle_reads = np.where(executing, 0, self._idle_reads + 1)
        settled = (self._idle_reads > SHOWN_PERIODS) & image.servo_on
        moving = settled & ~at_rest
        off = np.abs(image.position_command - image.position)
        away = settled & (off > np.maximum(5 * SETTLED_RAD, self._tolerance))
        short = image.motion_complete & (
            np.abs(image.position_command - self._targets) > SETTLED_RAD
        )
        self._note(executing & image.motion_complete, "motion_complete while it executes", image)
        self._note(overdue, f"executes {ENDED_S:g} s after the end of its command", image)
        self._note(moving, "idle with a velocity command", image)
        self._note(away, "idle with a position command that is not where it is", image)
        self._note(short, "motion_complete before the command is at its target", image)

    def _note(self, axes: np.ndarray, what: str, image: ProcessImage) -> None:
        for axis in np.flatnonzero(axes).tolist():
            shown = Operation(int(image.operation[axis])).name
            self._problems.setdefault(
                (axis, what),
                f"{self._stage}: axis {axis}: {what}; operation {shown}, velocity command"
                f" {image.velocity_command[axis]:.3g} rad/s",
            )


@contextmanager
def watching(harness: Harness) -> Iterator[Watch]:
    """Read in each period while the block runs; contradictions fail the check."""
    watch = Watch(harness)
    with harness.each_period(watch):
        yield watch
    assert not watch.problems, "; ".join(watch.problems)


def move(harness: Harness, watch: Watch, stage: str, targets: FloatArray) -> None:
    """Start moves of all axes to ``targets``, and wait until the image shows them."""
    watch.begin(stage)
    harness.move(harness.all, targets)
    harness.periods(SHOWN_PERIODS)
    watch.expect(targets)


def look_at_rest(harness: Harness) -> None:
    """Wait for rest, and look at some more reads."""
    harness.rest()
    harness.pass_time(LOOK_S)


@pytest.mark.clause("AxisDriver.read/commands", "AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.read/complete")
@pytest.mark.short_period
def test_each_read_of_a_move_agrees_with_itself(harness: Harness) -> None:
    start, driver = harness.image.position_command.copy(), harness.drivers.axes
    there = start + harness.travel()
    with watching(harness) as watch:
        for targets in (there, start):
            move(harness, watch, "move", targets)
            look_at_rest(harness)
            assert harness.image.motion_complete.all(), "a move that has ended is not complete"
        for stop, name in ((driver.stop, "stop"), (driver.quick_stop, "quick stop")):
            move(harness, watch, "move", start)
            look_at_rest(harness)
            move(harness, watch, "move that is stopped", there)
            harness.pass_time(0.1)
            watch.begin(name)
            stop(harness.all)
            look_at_rest(harness)
            assert not harness.image.motion_complete.any(), f"complete after a {name}"
        move(harness, watch, "move after a stop", start)
        look_at_rest(harness)
        assert harness.image.motion_complete.all(), "a move after a stop is not complete"


@pytest.mark.needs(Capability.VELOCITY_MODE)
@pytest.mark.clause("AxisDriver.read/commands", "AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.read/complete")
def test_each_read_of_a_velocity_command_agrees_with_itself(fresh: Harness) -> None:
    speeds, targets = fresh.speeds(JOG_SHARE), fresh.image.position_command + fresh.travel(0.2)
    ends: dict[str, Callable[[], None]] = {
        "velocity 0": lambda: jog(fresh, 0.0 * speeds),
        "stop": lambda: fresh.drivers.axes.stop(fresh.all),
        "quick stop": lambda: fresh.drivers.axes.quick_stop(fresh.all),
    }
    with watching(fresh) as watch:
        for sign, (name, end) in zip((1.0, -1.0, 1.0), ends.items(), strict=True):
            for axis in fresh.all:
                fresh.robot.axes.set_command_mode(axis, CommandMode.POSITION)
            move(fresh, watch, "move", targets)
            fresh.rest()
            assert fresh.image.motion_complete.all(), "a move that has ended is not complete"
            fresh.set_velocity_mode()
            watch.begin("velocity command after a move")
            jog(fresh, sign * speeds)
            fresh.pass_time(0.2)
            shown = fresh.image.operation
            assert (shown == Operation.VELOCITY).all(), f"operations {shown} of velocity commands"
            watch.begin(f"velocity command that ends by {name}")
            end()
            look_at_rest(fresh)


@pytest.mark.clause("AxisDriver.read/commands", "AxisDriver.read/states")
@pytest.mark.clause("AxisDriver.read/complete")
def test_each_read_of_a_stream_agrees_with_itself(streamed: Harness) -> None:
    """The stream is in position mode, after a move that is complete."""
    targets = streamed.image.position_command + streamed.travel(0.2)
    speeds, brake_s = streamed.speeds(STREAM_SHARE), STREAM_S - RAMP_S
    with watching(streamed) as watch:
        move(streamed, watch, "move", targets)
        streamed.rest()
    watch = Watch(streamed)
    watch.begin("stream after a move")
    start, began_ns = streamed.image.position_command.copy(), streamed.clock.now_ns()

    def send(image: ProcessImage) -> None:
        watch(image)
        distance_s, share = ramped((streamed.due_ns - began_ns) * 1e-9, RAMP_S, brake_s)
        streamed.stream(start + distance_s * speeds, share * speeds)

    claim = streamed.robot.axes.claimed("conformance", streamed.all)
    with claim, streamed.each_period(send):
        streamed.pass_time(STREAM_S + 0.1)
        shown = streamed.image.operation
        assert (shown == Operation.STREAM).all(), f"operations {shown} of streams"
    with streamed.each_period(watch):
        look_at_rest(streamed)
    assert not watch.problems, "; ".join(watch.problems)


@pytest.mark.needs(Capability.HOMING)
@pytest.mark.clause("AxisDriver.home/no-motion", "AxisDriver.read/measured")
def test_homing_shows_no_velocity(fresh: Harness) -> None:
    fresh.require_rescaling()
    fresh.move_all()
    fresh.rest()
    with no_velocity(fresh):
        for axis in fresh.all:
            fresh.robot.axes.home(axis)
            fresh.periods(5)


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("AxisDriver.set_polarity/measured", "AxisDriver.read/measured")
@pytest.mark.clause("AxisDriver.set_gear_ratio/counts")
def test_a_change_of_scale_shows_no_velocity(rescalable: Harness) -> None:
    axes = rescalable.robot.axes
    with no_velocity(rescalable):
        for axis in rescalable.all:
            for polarity in (-1, 1):
                axes.set_polarity(axis, polarity)
                rescalable.periods(5)
                axes.set_gear_ratio(axis, COUNTS, polarity * TURN / 2.0 + TURN)
                rescalable.periods(5)


@contextmanager
def no_velocity(harness: Harness) -> Iterator[None]:
    """Fail where a read of the block shows a velocity of an axis: they all stand."""
    fastest = np.zeros((2, harness.count))

    def look(image: ProcessImage) -> None:
        np.fmax(fastest, np.abs([image.velocity, image.velocity_command]), out=fastest)

    with harness.each_period(look):
        harness.periods(5)
        yield
        harness.periods(5)
    problems = [
        f"axis {axis} is at rest, its {name} is {fastest[row, axis]:.3g} rad/s in a read"
        for row, name in enumerate(("velocity", "velocity command"))
        for axis in harness.all
        if fastest[row, axis] > SPIKE_RAD_S
    ]
    assert not problems, "; ".join(problems)
