"""The axis driver of CiA 402 drives, with one looped drive behind it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from tests.plugins.cia402.looped_drive import PERIOD_NS, PERIOD_S, LoopedDrive, LoopedObjects

from robotd.api import (
    CommandMode,
    ConnectionState,
    DeviceTimeout,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
)
from robotd_cia402.axes import Cia402Master
from robotd_cia402.axis import Axis
from robotd_cia402.sync_timing import SyncTiming

FAST = Profile(velocity=1.0, acceleration=5.0, deceleration=5.0)


class LoopedAxes(Cia402Master[LoopedObjects]):
    """Axis driver of one looped drive, on no bus."""

    state = ConnectionState.COMMUNICATING

    def __init__(self, looped: LoopedDrive) -> None:
        super().__init__(looped.clock, PERIOD_S, stream_timeout_s=0.1)
        self.looped, self.timing = looped, SyncTiming(PERIOD_NS)
        self.axes, self._commands = [looped.axis], [looped.commands]

    def read(self, image: ProcessImage) -> None:
        self.looped.axis.observe(image)

    def settle(self) -> None:
        self.looped.run(2 * PERIOD_S)

    def fault(self) -> str:
        return ""

    def summary(self) -> str:
        return ""

    def open(self) -> None:
        """No bus."""

    def close(self) -> None:
        """No bus."""

    def start(self, timeout_s: float) -> None:
        """No bus."""

    def end(self) -> None:
        """No bus."""

    def force_off(self, axes: Sequence[Axis[LoopedObjects]]) -> None:
        """No bus."""


@pytest.fixture
def axes() -> LoopedAxes:
    """Servo on, at rest."""
    made = LoopedAxes(LoopedDrive())
    made.servo(0, on=True, timeout_s=1.0)
    return made


def test_the_servo_is_on_in_the_image_when_the_call_returns(axes: LoopedAxes) -> None:
    assert axes.looped.image.servo_on[0]
    axes.servo(0, on=False, timeout_s=1.0)
    assert not axes.looped.image.servo_on[0]


def test_motion_and_its_stops(axes: LoopedAxes) -> None:
    for stop in (axes.stop, axes.quick_stop):
        axes.move(0, 3.0, FAST)
        axes.looped.run(0.5)
        stop([0])
        axes.looped.run(0.5)
        assert axes.looped.axis.activity.is_idle
    axes.jog(0, FAST)
    axes.looped.run(0.5)
    assert axes.looped.image.velocity[0] == pytest.approx(1.0, abs=0.05)


def test_a_stream_begins_and_ends(axes: LoopedAxes) -> None:
    axes.begin_stream([0])
    assert axes.looped.axis.activity.streaming
    axes.end_stream([0])
    assert axes.looped.axis.activity.is_idle


def test_a_stream_that_ends_in_motion_brakes(axes: LoopedAxes) -> None:
    axes.set_command_mode(0, CommandMode.VELOCITY)
    axes.begin_stream([0])
    axes.looped.axis.follow(0.0, 0.5)
    axes.looped.run(0.5)
    axes.end_stream([0])
    axes.looped.run(1.0)
    assert axes.looped.axis.activity.is_idle
    assert axes.looped.image.velocity[0] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("mode", [CommandMode.POSITION, CommandMode.VELOCITY, CommandMode.TORQUE])
@pytest.mark.parametrize("by_supervision", [False, True])
def test_a_stop_while_a_stream_is_being_started_prevents_it(
    axes: LoopedAxes, mode: CommandMode, by_supervision: bool
) -> None:
    axes.set_command_mode(0, mode)
    prepare = axes._commands[0].prepare_stream

    def stop_meanwhile() -> None:
        prepare()
        if by_supervision:
            axes.looped.axis.brake(10.0)
        else:
            axes.stop([0])

    axes._commands[0].prepare_stream = stop_meanwhile  # type: ignore[method-assign]
    with pytest.raises(OperationError, match="stopped before the motion began"):
        axes.begin_stream([0])
    axes.looped.run(0.2)
    assert axes.looped.image.operation[0] == Operation.IDLE
    assert axes.looped.drive.position == pytest.approx(0.0, abs=1e-4)


def test_a_stream_of_a_lost_axis_does_not_begin(axes: LoopedAxes) -> None:
    axes.looped.objects.node.online = False
    with pytest.raises(NotReady, match="node 1: offline"):
        axes.begin_stream([0])
    assert not axes.looped.axis.activity.streaming


def test_the_scale_changes_with_the_servo_off_only(axes: LoopedAxes) -> None:
    with pytest.raises(NotReady, match="its scale cannot be changed while the servo is on"):
        axes.set_polarity(0, -1)
    axes.servo(0, on=False, timeout_s=1.0)
    axes.set_polarity(0, -1)
    axes.set_gear_ratio(0, 2e5, 2.0)
    assert axes.looped.axis.scaling.position == pytest.approx(-1e-5)


def test_a_scale_whose_ramp_cannot_be_written_is_not_in_force(axes: LoopedAxes) -> None:
    """Its caller goes on with the scale of before."""
    axes.servo(0, on=False, timeout_s=1.0)

    def no_answer(index: int, sub: int, value: int) -> None:
        raise DeviceTimeout("no answer")

    axes.looped.objects.write = no_answer  # type: ignore[method-assign]
    with pytest.raises(DeviceTimeout, match="no answer"):
        axes.set_gear_ratio(0, 2e5, 1.0)
    assert axes.looped.axis.scaling.position == pytest.approx(1e-5)


def test_an_alarm_is_cleared_and_the_axis_homed(axes: LoopedAxes) -> None:
    axes.looped.drive.trip(0x7121)
    axes.looped.run(0.5)
    axes.clear_alarm(0, 1.0)
    axes.servo(0, on=True, timeout_s=1.0)
    axes.home(0, 5.0)
    assert axes.looped.image.home_done[0]


def test_a_stream_without_setpoints_is_named_after_the_limit(axes: LoopedAxes) -> None:
    axes.begin_stream([0])
    begun_ns = axes.clock.now_ns() - 2 * PERIOD_NS
    assert axes.stream_problem(begun_ns + 100_000_000) == ""
    late_ns = begun_ns + 101_000_000
    assert axes.stream_problem(late_ns) == "joint1 (node 1): no setpoint for 0.1 s"
    axes.stream(np.zeros(1), np.zeros(1), axes.clock.now_ns())
    assert axes.stream_problem(axes.clock.now_ns() + 100_000_000) == ""
    axes.end_stream([0])
    assert axes.stream_problem(late_ns + 1_000_000_000) == ""
