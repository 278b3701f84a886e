"""A drive that leaves the commanded mode by itself, as another master makes it do."""

from __future__ import annotations

import pytest
from tests.plugins.cia402.looped_drive import FAST, LoopedDrive, peak_velocity

from robotd.api import DeviceTimeout, Operation
from robotd_cia402.controlword import DriveState
from robotd_cia402.object_numbers import INPUTS, MODE, MODE_DISPLAY, TARGET_TORQUE

PROFILE_TORQUE, CYCLIC_TORQUE, CYCLIC_POSITION = 4, 10, 8
FOREIGN_TORQUE = 200  # per mille of the rated one


class Seized(LoopedDrive):
    """A drive whose mode and torque somebody else may write after each frame of robotd.

    Attributes:
        mode: what is written; None: nothing.
        shown: mode that is displayed instead of the real one; None: the real one.
    """

    def __init__(self) -> None:
        super().__init__()
        self.mode: int | None = None
        self.shown: int | None = None
        send, take = self.objects.send, self.objects.take

        def overwritten() -> None:
            send()
            if self.mode is not None:
                self.objects.dictionary[MODE, 0] = self.mode
                self.objects.dictionary[TARGET_TORQUE, 0] = FOREIGN_TORQUE

        def displayed() -> None:
            take()
            if self.shown is not None:
                self.objects._taken[INPUTS.index(MODE_DISPLAY)] = self.shown

        self.objects.send = overwritten  # type: ignore[method-assign]
        self.objects.take = displayed  # type: ignore[method-assign]
        self.commands.enable(1.0)


@pytest.fixture
def drive() -> Seized:
    """At rest, with its servo on."""
    return Seized()


def test_the_axis_is_in_alarm_and_its_reason_names_both_modes(drive: Seized) -> None:
    drive.shown = PROFILE_TORQUE
    drive.run(0.5)
    assert drive.image.amp_alarm[0]
    assert drive.image.reason[0] == (
        "node 1: the drive has changed to mode 4 (profile torque) by itself,"
        " mode 8 (cyclic position) is commanded"
    )
    assert "drive has changed to mode 4" in drive.image.fault(0)


def test_a_mode_that_is_displayed_for_a_moment_is_no_alarm(drive: Seized) -> None:
    drive.shown = PROFILE_TORQUE
    drive.run(0.04)
    drive.shown = None
    drive.run(0.5)
    assert not drive.image.amp_alarm[0]
    assert drive.axis.report.state is DriveState.OPERATION_ENABLED


def test_a_drive_at_rest_that_gets_a_foreign_torque_is_stopped(drive: Seized) -> None:
    drive.mode = CYCLIC_TORQUE
    drive.run(0.05)
    assert drive.image.velocity[0] > 0.05
    drive.run(1.0)
    assert drive.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    assert drive.image.velocity[0] == pytest.approx(0.0, abs=1e-3)


def test_a_stream_ends_and_the_return_to_the_mode_is_no_jump(drive: Seized) -> None:
    drive.commands.prepare_stream()
    drive.commands.begin_stream()
    for step in range(50):
        drive.axis.follow(0.002 * step, 0.5)
        drive.run(0.004)
    drive.mode = CYCLIC_TORQUE
    for step in range(50, 150):
        drive.axis.follow(0.002 * step, 0.5)
        drive.run(0.004)
    assert drive.image.operation[0] != Operation.STREAM
    drive.run(1.0)
    place = drive.drive.position
    drive.mode = None
    assert peak_velocity(drive) < 0.01
    assert not drive.image.amp_alarm[0]
    drive.commands.enable(1.0)  # nothing more than leaving the quick stop
    assert peak_velocity(drive) < 0.01
    assert drive.drive.position == pytest.approx(place, abs=1e-3)
    assert drive.axis.report.state is DriveState.OPERATION_ENABLED


def test_the_quick_stop_is_not_left_in_the_wrong_mode(drive: Seized) -> None:
    drive.shown = PROFILE_TORQUE
    drive.run(0.5)
    for command in (drive.commands.clear_alarm, drive.commands.enable):
        with pytest.raises(DeviceTimeout, match=r"mode 4|torque mode"):
            command(2.0)
        assert drive.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    drive.shown = None
    drive.commands.clear_alarm(2.0)
    drive.commands.move(1.0, FAST)
    drive.run(2.0)
    assert drive.drive.position == pytest.approx(1.0, abs=1e-3)


def test_servo_off_and_on_begins_anew(drive: Seized) -> None:
    drive.shown = PROFILE_TORQUE
    drive.run(0.5)
    drive.commands.disable(1.0)
    assert not drive.image.amp_alarm[0]
    with pytest.raises(DeviceTimeout, match="shows mode 4"):
        drive.commands.enable(5.0)
    drive.shown = None
    drive.run(0.1)
    drive.commands.enable(5.0)
    drive.run(0.5)
    assert not drive.image.amp_alarm[0]


def test_a_homing_that_ends_in_another_mode_is_no_loss(drive: Seized) -> None:
    drive.commands.home(5.0)
    drive.run(0.5)
    assert not drive.image.amp_alarm[0]
    assert drive.image.home_done[0]
