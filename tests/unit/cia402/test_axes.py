"""The axis driver of CiA 402 drives, with one looped drive behind it."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from tests.unit.cia402.looped_drive import PERIOD_S, LoopedDrive

from robotd.api import (
    CommandMode,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    Profile,
)
from robotd_cia402.axes import Cia402Axes

FAST = Profile(velocity=1.0, acceleration=5.0, deceleration=5.0)


class LoopedMaster:
    """Master of one looped drive."""

    def __init__(self, looped: LoopedDrive) -> None:
        self.looped, self.axes, self.clock = looped, [looped.axis], looped.clock
        self.begun = 0

    def read(self, image: ProcessImage) -> None:
        self.looped.axis.observe(image)

    def stream(self, position: Sequence[float], velocity: Sequence[float], due_ns: int) -> None:
        self.looped.axis.follow(position[0], velocity[0])

    def stream_torque(self, torque: Sequence[float]) -> None:
        self.looped.axis.follow_torque(torque[0])

    def begin_stream(self) -> None:
        self.begun += 1

    def settle(self) -> None:
        self.looped.run(2 * PERIOD_S)


class LoopedAxes(Cia402Axes):
    """Axis driver of one looped drive."""

    def __init__(self, looped: LoopedDrive) -> None:
        self.master, self.looped = LoopedMaster(looped), looped
        super().__init__(self.master)


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
    assert axes.master.begun == 1
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
    axes.looped.objects.online = False
    with pytest.raises(NotReady, match="node 1: offline"):
        axes.begin_stream([0])
    assert axes.master.begun == 0


def test_the_scale_changes_with_the_servo_off_only(axes: LoopedAxes) -> None:
    with pytest.raises(NotReady, match="its scale cannot be changed while the servo is on"):
        axes.set_polarity(0, -1)
    axes.servo(0, on=False, timeout_s=1.0)
    axes.set_polarity(0, -1)
    axes.set_gear_ratio(0, 2e5, 2.0)
    assert axes.looped.axis.scaling.position == pytest.approx(-1e-5)


def test_an_alarm_is_cleared_and_the_axis_homed(axes: LoopedAxes) -> None:
    axes.looped.drive.trip(0x7121)
    axes.looped.run(0.5)
    axes.clear_alarm(0, 1.0)
    axes.servo(0, on=True, timeout_s=1.0)
    axes.home(0, 5.0)
    assert axes.looped.image.home_done[0]
