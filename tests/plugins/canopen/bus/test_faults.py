"""Faults during a trajectory: controlled stop, reason, and recovery."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig
from tests.plugins.canopen.bus.drives_process import RATE_HZ, SOON_STALE
from tests.plugins.canopen.bus.harness import Harness, broken
from tests.rearming_checks import check_recovery

from robotd.control.groups.problem import ProblemKind
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode, ConnectionState
from robotd.errors import ConnectError, DeviceTimeout, NotReady, RobotdError
from robotd.motion.profile import Profile
from robotd.plugin import fault_isolation
from robotd_canopen.frame import Frame
from robotd_canopen.node import NmtCommand
from robotd_cia402.simulated.drive import SimulatedState

WINDOW = {"startup": [{"object": "0x6065", "value": 2000}], "counts_per_rad": 1e5}


def recover(harness: Harness, node: int = 2) -> None:
    """Recover as an operator does."""
    harness.inject(f"{node} heal")
    harness.robot.connection.start_communication()
    harness.until(lambda: harness.robot.connection.ready and not harness.image.offline.any())
    harness.robot.servos.enable()
    execution = harness.follow(0.5, 0.1)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("silence", "TPDO"),
        ("drop 1.0", "TPDO"),
        ("late 2.0", "TPDO"),
        ("reboot", "it was reset and has lost its configuration"),
        ("stop", "it went to stopped by itself"),
    ],
)
def test_a_lost_drive(open_rig: OpenRig, fault: str, cause: str) -> None:
    with open_rig(SMALL, engine=SOON_STALE) as harness:
        stop = broken(harness, f"2 {fault}")
        assert stop.execution.outcome is Outcome.FAULT
        assert f"drive is offline (node 2: {cause}" in stop.execution.message
        assert stop.is_controlled
        engine = harness.robot.connection
        assert engine.state is ConnectionState.UNKNOWN
        assert f"elbow (node 2): {cause}" in engine.fault
        assert list(harness.image.offline) == [False, True, False]
        assert not engine.ready
        with pytest.raises(NotReady, match=r"elbow \(node 2\)"):
            engine.require_ready()
        slaves = {slave.id: slave for slave in harness.device_state().nodes}
        assert cause in slaves[2].fault
        assert slaves[2].offline
        assert not slaves[1].fault
        recover(harness)


@pytest.mark.parametrize(
    ("fault", "alarm"),
    [
        ("trip 0x3210", "amplifier alarm 12816 (node 2: EMCY 0x3210 DC link over-voltage)"),
        ("block", "amplifier alarm 34321 (node 2: EMCY 0x8611 following error)"),
    ],
)
def test_a_drive_that_trips(open_rig: OpenRig, fault: str, alarm: str) -> None:
    with open_rig(SMALL, axis_defaults=WINDOW) as harness:
        stop = broken(harness, f"2 {fault}")
        assert stop.execution.outcome is Outcome.FAULT
        assert f": {alarm}" in stop.execution.message
        assert stop.is_controlled
        assert harness.robot.connection.ready, "the network itself is well"
        with pytest.raises(RobotdError, match="EMCY"):
            harness.robot.axes.move([Move(1, 0.0, Profile(1.0, 5.0, 5.0))])
        state = harness.device_state()
        assert "node 2: EMCY" in state.note
        assert "EMCY" in state.nodes[1].fault
        assert state.details["latest EMCY"].startswith("node 2: EMCY")
        recover(harness)
        state = harness.device_state()
        assert state.details["EMCY in force"] == "none"
        assert "node 2: EMCY 0x0000 no error" in state.details["latest EMCY"]


def test_a_statusword_that_lies_is_not_switched_on_again(open_rig: OpenRig) -> None:
    with open_rig(SMALL, engine={"servo_timeout_s": 0.5}) as harness:
        stop = broken(harness, "2 statusword 0x0250")
        assert stop.execution.outcome is Outcome.FAULT
        assert "elbow" in stop.execution.message
        assert harness.image.reason[1] == "node 2: statusword 0x0250 (switch on disabled)"
        assert not harness.image.servo_on[1]
        with pytest.raises(ConnectError, match=r"elbow: node 2: .*statusword 0x0250"):
            harness.robot.servos.enable()
        recover(harness)


def test_a_drive_that_changes_its_mode_is_a_problem_that_names_axis_and_mode(
    open_rig: OpenRig,
) -> None:
    changed = "the drive has changed to mode 4 (profile torque) by itself"
    with open_rig(SMALL, engine={"servo_timeout_s": 1.0}) as harness:
        stop = broken(harness, "2 mode 4")
        assert stop.execution.outcome is Outcome.FAULT
        assert stop.execution.message.startswith("elbow at ")
        assert f"node 2: {changed}" in stop.execution.message
        assert stop.is_controlled
        [problem] = harness.robot.find_problems()
        assert (problem.kind, problem.axes) == (ProblemKind.ALARM, ("elbow",))
        assert changed in problem.reason
        with pytest.raises(RobotdError, match="mode 4"):
            harness.robot.recover()
        harness.inject("2 heal")
        harness.until(lambda: not harness.robot.find_problems())
        execution = harness.follow(0.5, 0.1)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_a_reset_ends_the_emergency_before_it(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        harness.inject("2 emcy 0x3210")
        harness.until(lambda: harness.device_state().details["EMCY in force"] != "none")
        harness.inject("2 reboot")
        harness.until(lambda: harness.image.offline[1])
        assert "EMCY 0x3210" in harness.image.reason[1]
        recover(harness)
        assert harness.device_state().details["EMCY in force"] == "none"
        assert harness.device_state().nodes[1].fault == ""


def test_an_error_reset_with_remaining_errors_leaves_the_node_in_error(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:

        def in_force() -> str:
            return harness.device_state().details["EMCY in force"]

        harness.inject("2 emcy 0x3210")
        harness.until(lambda: "0x3210" in in_force())
        harness.inject("2 emcy 0 0x09")
        harness.until(lambda: "0x0000" in in_force())
        assert "remaining error register 0x09 (generic, temperature)" in in_force()
        harness.inject("2 emcy 0")
        harness.until(lambda: in_force() == "none")


def test_a_drive_that_is_lost_while_another_one_starts(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        bring_up = harness.master._bring_up
        start = bring_up.start

        def start_and_lose(*arguments: Any) -> None:
            start(*arguments)
            harness.inject("3 drop 1.0")
            harness.until(lambda: harness.image.offline[2])

        broken(harness, "2 reboot")
        bring_up.start = start_and_lose  # type: ignore[method-assign]
        with suppress(RobotdError):
            harness.robot.connection.start_communication()
        bring_up.start = start  # type: ignore[method-assign]
        assert "node 3" in harness.device.fault()
        assert harness.device.state() is ConnectionState.UNKNOWN
        harness.inject("3 heal")
        harness.until(lambda: harness.device.state() is ConnectionState.COMMUNICATING)
        harness.until(lambda: not harness.image.offline.any())
        recover(harness)


def test_a_wrong_identity_after_a_reset(open_rig: OpenRig) -> None:
    identity = {"vendor_id": 0x1234}
    with open_rig(SMALL, axis_defaults={"counts_per_rad": 1e5, "identity": identity}) as harness:
        broken(harness, "2 reboot")
        harness.inject("2 identity 0x4321")
        with pytest.raises(ConnectError, match=r"vendor_id.*is 0x00004321, expected is 0x00001234"):
            harness.robot.connection.start_communication()
        harness.inject("2 identity 0x1234")
        recover(harness)


def test_objects_that_refuse_hurt_only_who_writes_them(open_rig: OpenRig) -> None:
    move = Move(1, 0.2, Profile(0.6, 3.0, 3.0))
    with open_rig(SMALL, sdo_timeout_s=0.2) as harness:
        with harness.robot.follower.follow(harness.request(0.8, 0.4)) as execution:
            harness.inject("2 abort 0x6081 0x08000022")
            harness.inject("2 timeout 0x6083")
            assert execution.wait(5)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        with pytest.raises(RobotdError, match=r"elbow \(node 2\).*0x6081.*abort 0x08000022"):
            harness.robot.axes.move([move])
        harness.network.call(harness.drive(2).faults.aborts.clear)
        with pytest.raises(DeviceTimeout, match=r"elbow \(node 2\).*0x6083.*no answer"):
            harness.robot.axes.move([move])
        recover(harness)


@pytest.mark.parametrize("command", ["move", "jog"])
def test_a_command_that_was_given_up_begins_no_motion(
    open_rig: OpenRig, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """A drive may answer SDO more slowly than the core waits for a command."""
    monkeypatch.setattr(fault_isolation, "COMMAND_BUDGET_S", 0.5)
    with open_rig(SMALL) as harness:
        profile, drive, written = Profile(0.6, 3.0, 3.0), harness.master.axes[1].drive, Event()
        write = drive.write

        def slow(index: int, sub: int, value: int) -> None:
            write(index, sub, value)
            if index == 0x6083:  # the last one
                written.wait(5.0)

        drive.write = slow  # type: ignore[method-assign]
        axes = harness.robot.axes
        begin = partial(axes.move, [Move(1, 0.2, profile)])
        if command == "jog":
            axes.set_command_mode(1, CommandMode.VELOCITY)
            begin = partial(axes.jog, [Jog(1, profile)])
        with pytest.raises(DeviceTimeout, match=r"did not return within 0\.5 s"):
            begin()
        written.set()
        with harness.master.axes[1].lock:  # of the command
            pass
        syncs = harness.master.sync.count
        harness.until(lambda: harness.master.sync.count > syncs + RATE_HZ)
        assert abs(harness.image.position[1]) < 1e-3


def test_a_servo_that_is_switched_off_while_a_second_node_is_looked_for_stays_off(
    open_rig: OpenRig,
) -> None:
    with open_rig(SMALL) as harness:
        harness.robot.axes.servo(1, False)
        drive, looks, looked = harness.master.axes[1].drive, Event(), Event()
        require_unique, errors = drive.require_unique, list[RobotdError]()

        def look(timeout_s: float) -> None:
            looks.set()
            looked.wait(60.0)
            require_unique(timeout_s)

        def switch_on() -> None:
            try:
                harness.master.servo(1, True, 5.0)
            except RobotdError as error:
                errors.append(error)

        drive.require_unique = look  # type: ignore[method-assign]
        on = Thread(target=switch_on)
        on.start()
        assert looks.wait(60.0)
        harness.master.servo(1, False, 5.0)
        looked.set()
        on.join()
        assert not harness.image.servo_on[1]
        assert "switched off before the servo was on" in str(errors)


def test_late_and_some_lost_pdos_are_lived_with(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        harness.inject("1 drop 0.2")
        harness.inject("2 late 0.002")
        assert harness.follow(0.8, 0.4).outcome is Outcome.SUCCEEDED


def test_an_emergency_alone_stops_nothing_and_is_kept(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        with harness.robot.follower.follow(harness.request(0.6, 0.3)) as execution:
            harness.inject("2 emcy 0xFF12")
            assert execution.wait(5)
        assert execution.outcome is Outcome.SUCCEEDED
        assert (
            "node 2: EMCY 0xFF12 vendor specific" in harness.device_state().details["latest EMCY"]
        )


def test_a_bus_that_goes_away(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        stop = broken(harness, harness.break_bus, healthy=())
        assert stop.execution.outcome is Outcome.FAULT
        assert "failed: CanOperationError" in stop.execution.message
        assert "failed: CanOperationError" in harness.robot.connection.fault
        recover(harness)


def test_the_drives_stop_when_the_daemon_is_gone(open_rig: OpenRig) -> None:
    with open_rig() as harness:
        harness.robot.control_loop.stop()
        drives = [harness.drive(node).drives[0] for node in range(1, 7)]
        harness.until(lambda: all(drive.get(0x603F) == 0x8130 for drive in drives))
        harness.master.end()  # nobody is left who could stop it in order


@pytest.mark.parametrize("in_a_period", [False, True])
def test_a_drive_that_gets_no_frames_is_switched_off_by_sdo(
    open_rig: OpenRig, monkeypatch: pytest.MonkeyPatch, in_a_period: bool
) -> None:
    """Without the control loop no frame reaches it; the last period may end late."""
    with open_rig(SMALL, axis_defaults=WINDOW) as harness:
        harness.robot.axes.set_command_mode(1, CommandMode.VELOCITY)
        harness.robot.axes.jog([Jog(1, Profile(0.3, 5.0, 5.0))])
        harness.until(lambda: harness.image.velocity[1] > 0.29)
        harness.robot.control_loop.stop()
        master, leave = harness.master, harness.master._leave_all

        def within_a_period(state: ConnectionState) -> None:
            leave(state)
            for axis in master.axes if in_a_period else ():
                axis.observe(harness.image)

        monkeypatch.setattr(master, "_leave_all", within_a_period)
        harness.device.stop_communication(0.1)
        assert harness.drive(2).drives[0].state is SimulatedState.SWITCH_ON_DISABLED
        assert harness.master.confirmed_off() == [True] * 3


def test_a_pause_of_the_computer_loses_no_drive(open_rig: OpenRig) -> None:
    """Heartbeats that wait to be read are no silence."""
    with open_rig(SMALL) as harness:
        harness.pause_cycle(1.0)
        harness.until(lambda: harness.robot.connection.ready)
        assert not harness.master.supervision.faults
        assert np.isfinite(harness.positions()).all()


def test_a_recovery_from_an_nmt_stop_lasts(open_rig: OpenRig) -> None:
    """The drives report that they are on until they obey the first frame after the restart."""
    with open_rig() as harness:
        harness.master.bus.send(Frame(0, bytes([NmtCommand.STOP, 0])))
        # Of each drive: the report of one that is still on its way would take it off again.
        nodes = harness.master.nodes
        harness.until(lambda: not any(nodes[number].online for number in range(1, 7)))
        lines: list[str] = []
        harness.robot.recover(lines.append)
        assert lines[-1].startswith("verified: 6 axes on")
        syncs = harness.master.sync.count
        harness.until(lambda: harness.master.sync.count > syncs + RATE_HZ)
        assert harness.robot.problems == []


def test_a_servo_that_does_not_go_on_says_why(open_rig: OpenRig) -> None:
    with open_rig(SMALL, enable=False) as harness:
        harness.inject("1 statusword 0x0250")
        with pytest.raises(DeviceTimeout, match=r"axis 0: node 1: .*switch on disabled"):
            harness.robot.axes._driver.servo(0, True, 1.0)


@pytest.mark.parametrize("fault", ["trip 0x3210", "silence"])
def test_a_client_that_commands_on_moves_nothing_after_the_recovery(
    open_rig: OpenRig, fault: str
) -> None:
    with open_rig(SMALL) as harness:
        check_recovery(
            harness.robot,
            lambda: harness.inject(f"1 {fault}"),
            lambda: harness.inject("1 heal"),
        )


@pytest.mark.parametrize("velocity_mode", ["pv", "csv"])
def test_a_lost_drive_that_receives_stops_its_jog(open_rig: OpenRig, velocity_mode: str) -> None:
    with open_rig(SMALL, axis_defaults=WINDOW | {"velocity_mode": velocity_mode}) as harness:
        harness.robot.axes.set_command_mode(1, CommandMode.VELOCITY)
        harness.robot.axes.jog([Jog(1, Profile(0.3, 5.0, 5.0))])
        check_lost_drive_stops(harness)


def test_a_lost_drive_that_receives_stops_its_move(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        harness.robot.axes.move([Move(1, 2.8, Profile(0.3, 5.0, 5.0))])
        check_lost_drive_stops(harness)


def check_lost_drive_stops(harness: Harness) -> None:
    """Nothing that axis 1 sends arrives, in motion; it must stop, and stay where it is."""
    harness.until(lambda: harness.image.velocity[1] > 0.29)
    harness.inject("2 drop 1.0")
    harness.until(lambda: harness.image.offline[1])
    harness.until(lambda: speed(harness) == 0.0, 5.0)
    assert not harness.image.operation[1]
    harness.inject("2 heal")
    harness.until(lambda: not harness.image.offline[1])
    assert speed(harness) == 0.0


def test_the_end_of_communication_switches_off_a_lost_drive_that_receives(
    open_rig: OpenRig,
) -> None:
    """Not every drive watches the heartbeat of robotd."""
    with open_rig(SMALL) as harness:
        harness.inject("2 drop 1.0")
        harness.until(lambda: bool(harness.image.offline[1]))
        harness.robot.connection.stop_communication()
        assert harness.drive(2).drives[0].state not in (
            SimulatedState.OPERATION_ENABLED,
            SimulatedState.QUICK_STOP_ACTIVE,
        )
        assert harness.master.confirmed_off() == [True] * 3


def speed(harness: Harness) -> float:
    """Return the commanded velocity inside the drive of axis 1, which no frame shows."""
    return harness.network._machine.command(1)[1]
