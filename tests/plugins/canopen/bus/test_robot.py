"""The whole robot on simulated drives: motion, I/O, diagnostics."""

from __future__ import annotations

from typing import Any

import can
import numpy as np
import pytest
from tests.plugins.canopen.bus.conftest import SMALL, OpenRig
from tests.plugins.canopen.bus.drives_process import RATE_HZ

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.bus_status import BusState
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation
from robotd.errors import ConnectError
from robotd.motion.profile import Profile

PROFILE = Profile(1.0, 5.0, 5.0)
SLOWLY = Profile(0.3, 5.0, 5.0)  # a stop may come late on a busy computer


@pytest.mark.daily
def test_a_trajectory_ends_where_it_should_and_has_no_steps(open_rig: OpenRig) -> None:
    with open_rig() as harness:
        seen: list[tuple[int, np.ndarray]] = []

        def note(image: ProcessImage) -> None:
            seen.append((image.stamp_ns, image.position_command.copy()))

        harness.robot.control_loop.every(RATE_HZ, "seen", note)
        execution = harness.follow(1.0, 0.6)
        assert execution.outcome is Outcome.SUCCEEDED
        assert np.abs(harness.positions() - 0.6).max() < 2e-3
        # The image has the setpoint of the period before: each belongs to the stamp before its
        # own. A period that was missed moves both on, so no load on the computer shows here.
        rows = list(seen)  # the control loop goes on
        times_s = np.array([stamp_ns for stamp_ns, _ in rows])[:-1] * 1e-9
        setpoints = np.array([setpoint for _, setpoint in rows])[1:]
        speeds = np.abs(np.diff(setpoints, axis=0)) / np.diff(times_s)[:, np.newaxis]
        assert 0.6 < speeds.max() < 2 * 0.6  # from rest to rest, the fastest is 1.5 to 1.875


def test_no_drive_gets_a_leap_after_the_cycle_has_stood(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        axis = harness.master.axes[0]
        transmit, targets = axis.transmit, list[float]()

        def noted(*arguments: Any) -> None:
            targets.append(axis.setpoint.position)
            transmit(*arguments)

        axis.transmit = noted  # type: ignore[method-assign]
        with harness.robot.follower.follow(harness.request(2.0, 1.0)) as execution:
            for position, pause_s in ((0.3, 0.06), (0.6, 0.03)):
                harness.until(lambda position=position: harness.image.position[0] > position)  # type: ignore[misc]
                harness.pause_cycle(pause_s)
            assert execution.wait(8)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        assert abs(harness.positions()[0] - 1.0) < 2e-3
        fastest = np.abs(np.diff(targets)).max() * RATE_HZ
        assert fastest < 2.0, "the path has 0.75 rad/s; made good in one period it would be 9"


def test_cancel_stops_and_the_next_goal_starts_from_there(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        with harness.robot.follower.follow(harness.request(1.5, 0.8)) as execution:
            harness.until(lambda: harness.image.position[0] > 0.2)
            execution.cancel()
            assert execution.wait(5)
        assert execution.outcome is Outcome.CANCELED
        assert harness.follow(0.5, 0.3).outcome is Outcome.SUCCEEDED


def test_profile_position_moves_stop_and_go_on(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        harness.robot.axes.move([Move(0, 0.2, PROFILE)])
        harness.idle(0)
        assert abs(harness.image.position[0] - 0.2) < 2e-3
        assert harness.image.motion_complete[0]
        harness.robot.axes.move([Move(0, 2.0, SLOWLY)])
        harness.until(lambda: harness.image.position[0] > 0.5)
        harness.robot.axes.stop([0])
        harness.idle(0)
        stopped = harness.image.position[0]
        assert stopped < 1.0
        harness.robot.axes.move([Move(0, stopped + 0.1, PROFILE)])
        harness.idle(0)
        assert abs(harness.image.position[0] - stopped - 0.1) < 2e-3


def test_a_quick_stop_keeps_the_servo_on_and_can_be_left(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        harness.robot.axes.move([Move(1, 2.0, PROFILE)])
        harness.until(lambda: harness.image.position[1] > 0.2)
        harness.robot.axes.quick_stop([1])
        harness.idle(1)
        assert harness.image.servo_on[1]
        assert harness.follow(0.5, 0.4).outcome is Outcome.SUCCEEDED


def test_velocity_by_the_drives_ramp_and_by_ours(open_rig: OpenRig) -> None:
    for mode in ("pv", "csv"):
        defaults = {"counts_per_rad": 1e5, "velocity_mode": mode}
        with open_rig(SMALL, enable=False, axis_defaults=defaults) as harness:
            harness.robot.axes.servo(2, True)
            harness.robot.axes.set_command_mode(2, CommandMode.VELOCITY)
            harness.robot.axes.jog([Jog(2, Profile(-0.4, 2.0, 2.0))])
            harness.until(lambda: abs(harness.image.velocity[2] + 0.4) < 1e-3)
            assert harness.image.operation[2] == Operation.VELOCITY
            harness.robot.axes.jog([Jog(2, Profile(0.0, 2.0, 2.0))])
            harness.idle(2)
            assert abs(harness.image.velocity[2]) < 1e-3


def test_a_drive_that_has_only_interpolated_position(open_rig: OpenRig) -> None:
    only = 1 << 6 | 1 << 2 | 1 << 0  # interpolated and profile position, profile velocity
    for stream_mode in ("csp", "ip"):
        defaults = {"counts_per_rad": 1e5, "stream_mode": stream_mode}
        with open_rig(SMALL, enable=False, axis_defaults=defaults) as harness:
            harness.robot.connection.stop_communication()
            for node in (1, 2, 3):
                harness.drive(node).values[0x6502, 0] = only
            if stream_mode == "csp":
                with pytest.raises(ConnectError, match="stream_mode needs cyclic_position"):
                    harness.robot.connection.start_communication()
                continue
            harness.robot.connection.start_communication()
            harness.robot.servos.enable()
            assert harness.follow(0.6, 0.3).outcome is Outcome.SUCCEEDED
            assert harness.positions()[:2] == pytest.approx([0.3, 0.3], abs=2e-3)
            harness.robot.axes.move([Move(0, 0.1, PROFILE)])
            harness.idle(0)
            assert abs(harness.image.position[0] - 0.1) < 2e-3


def test_homing_makes_here_zero(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        harness.follow(0.5, 0.3)
        harness.robot.axes.home(1)
        assert abs(harness.image.position[1]) < 1e-3
        assert harness.image.home_done[1]
        assert abs(harness.image.position_command[1]) < 1e-3


def test_the_gripper_is_an_output_and_a_start_does_not_switch_it(open_rig: OpenRig) -> None:
    with open_rig(enable=False) as harness:
        assert harness.robot.gripper is not None
        harness.robot.gripper.command(True)
        harness.until(lambda: harness.module(16).outputs[0] == 1)
        harness.module(16).faults.silent = False
        harness.network.call(lambda: harness.module(16).set_input_bit(1, 3, value=True))
        harness.until(lambda: harness.robot.io.input_bit(1, 3))
        assert harness.robot.io.output_bytes(0, 2) == b"\x01\x00"


@pytest.mark.daily
def test_diagnostics_say_what_a_can_network_has(open_rig: OpenRig) -> None:
    with open_rig(enable=False) as harness:
        state = harness.robot.fieldbus.status(0)
        assert [node.id for node in state.nodes] == [1, 2, 3, 4, 5, 6, 16]
        assert all(node.state is BusState.OPERATIONAL and not node.offline for node in state.nodes)
        assert "CANopen" in state.note
        assert state.nodes[0].product_code == 0x402
        harness.until(lambda: harness.device_state().details["bus load (%)"] != "0")
        found = harness.device_state().details
        assert found["computed bus load (%)"] == "32"
        assert int(found["frames received"]) > 100 < int(found["frames sent"])
        for name in ("malformed frames", "error frames", "failed sends", "lost heartbeats"):
            assert found[name] == "0"
        assert float(found["largest SYNC deviation (ms)"]) >= 0.0
        assert found["latest EMCY"] == "none"


def test_error_frames_are_told_in_words(open_rig: OpenRig) -> None:
    with open_rig(SMALL, enable=False) as harness:
        with can.Bus(interface="virtual", channel=harness.master.bus.name) as bus:
            bus.send(can.Message(arbitration_id=0x20, data=bytes(8), is_error_frame=True))
        harness.until(lambda: harness.device_state().details["error frames"] != "0")
        text = harness.device_state().details["error frames"]
        assert text == "1, the latest: no acknowledgement: no other node listens"
        harness.robot.fieldbus.reset_statistics(0)
        assert harness.device_state().lost_frames == 0


def test_drives_follow_a_stream_and_a_goal_after_it(open_rig: OpenRig) -> None:
    with open_rig(SMALL) as harness:
        robot, clock = harness.robot, harness.robot.clock
        with robot.stream(mode="smooth", timeout_s=1.0) as stream:
            joints = len(stream.joints)
            for index in range(45):
                stream.send([min(0.02 * index, 0.6)] * joints)
                clock.sleep_until_ns(clock.now_ns() + 33_000_000)
            harness.until(lambda: abs(harness.positions()[0] - 0.6) < 2e-3)
            assert stream.open, stream.message
            for index in range(15):
                stream.send([0.6 - 0.01 * index] * joints)
                clock.sleep_until_ns(clock.now_ns() + 33_000_000)
        assert stream.message == "closed by the client"
        assert harness.follow(1.0, 0.2).outcome is Outcome.SUCCEEDED
