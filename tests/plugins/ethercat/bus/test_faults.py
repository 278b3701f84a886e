"""Faults in motion over real frames: controlled stop, cause, return without motion, recovery."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.plugins.ethercat.bus.robot import EthercatRobot, started
from tests.rearming_checks import check_recovery

from robotd.clock import MonotonicClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.state import ConnectionState
from robotd_ethercat.simulate_command import MASTER

SPEED_RAD_S = 0.5
STOP_RAD = 0.3  # from detection of a fault to rest, with the stalls of a busy computer


@pytest.fixture(scope="module")
def running() -> Iterator[EthercatRobot]:
    with started() as robot:
        yield robot


@pytest.fixture
def robot(running: EthercatRobot) -> Iterator[EthercatRobot]:
    yield running
    running.heal()


def fault_in_motion(robot: EthercatRobot, line: str) -> str:
    """Inject ``line`` into a slow move; return why it ended, after all axes are at rest."""
    start = robot.image.position[0]
    target = -1.0 if start > 0 else 1.0
    request = robot.request(abs(target - start) / SPEED_RAD_S, target, target)
    with robot.robot.follower.follow(request) as execution:
        robot.until(lambda: abs(robot.image.position[0] - start) > 0.1)
        robot.inject(line)
        assert execution.wait(15.0)
    assert execution.outcome is Outcome.FAULT
    assert abs(robot.image.position[0] - start) < 0.1 + STOP_RAD + SPEED_RAD_S
    return execution.message


@pytest.mark.daily
def test_a_drive_that_trips_stops_the_arm_and_is_named(robot: EthercatRobot) -> None:
    message = fault_in_motion(robot, "2 trip 0x8611")
    assert "elbow" in message
    assert "8611" in message or "34321" in message


def test_a_cut_cable_stops_the_arm_and_its_return_moves_nothing(robot: EthercatRobot) -> None:
    fault_in_motion(robot, "2 cut")
    robot.until(lambda: robot.image.offline.tolist() == [True, True, False])
    assert "no answer: check its power, and the cable before it" in robot.device.fault()
    robot.inject("2 join")
    robot.until(lambda: robot.device.state() is ConnectionState.COMMUNICATING)
    robot.until(lambda: not robot.image.offline.any())
    robot.until(lambda: not robot.image.servo_on[1])
    assert robot.image.position_command[1] == pytest.approx(robot.image.position[1], abs=1e-3)
    robot.robot.recover()
    assert robot.image.servo_on[:2].all()


def test_a_slave_that_was_switched_off_needs_a_start_of_communication(
    robot: EthercatRobot,
) -> None:
    fault_in_motion(robot, "2 off")
    robot.inject("2 on")
    robot.until(lambda: "it was reset and has lost its configuration" in robot.device.fault())
    robot.robot.recover()
    assert robot.device.state() is ConnectionState.COMMUNICATING
    assert robot.image.servo_on[:2].all()


def test_a_bus_without_frames_is_found_and_comes_back_with_servos_off(
    robot: EthercatRobot,
) -> None:
    fault_in_motion(robot, "0 loss 1.0")
    robot.until(lambda: len(robot.master.supervision.lost) == 4)
    robot.inject("0 loss 0.0")
    robot.until(lambda: robot.device.state() is ConnectionState.COMMUNICATING)
    robot.until(lambda: not robot.image.servo_on.any())
    robot.robot.recover()
    assert robot.image.servo_on[:2].all()


def test_an_interface_that_sends_nothing_gets_one_frame(robot: EthercatRobot) -> None:
    """A rate of one byte per second lets the frames wait, as a network driver that hangs."""
    master, exchange = robot.master, robot.master.exchange
    set_rate(robot, "8bit")
    try:
        robot.until(lambda: exchange.blocked)
        frames, cycles = exchange.frames, master._cycles
        robot.until(lambda: master._cycles > cycles + 100)
        assert exchange.frames == frames
    finally:
        set_rate(robot, "1gbit")
    assert any("interface has sent no frame" in fault for fault in master.supervision.faults)
    robot.until(lambda: robot.device.state() is ConnectionState.COMMUNICATING)
    robot.robot.recover()
    assert robot.image.servo_on[:2].all()


def set_rate(robot: EthercatRobot, rate: str) -> None:
    limits = ["rate", rate, "burst", "2000", "limit", "100000"]
    command = ["tc", "qdisc", "replace", "dev", MASTER, "root", "tbf", *limits]
    if shutil.which("tc") is None:
        pytest.skip("no tc: iproute2 is not installed")

    def run() -> None:
        subprocess.run(command, check=True, timeout=10.0)

    assert robot.device.simulation is not None
    robot.device.simulation.run(run)


def test_an_al_error_of_a_slave_is_given_in_words(robot: EthercatRobot) -> None:
    fault_in_motion(robot, "2 al 0x001A")
    text = "elbow (slave 2): it went to SafeOp by itself: AL status 0x001A: synchronization error"
    robot.until(lambda: any(text in fault for fault in robot.master.supervision.faults))


def test_a_recovery_from_safe_op_lasts(robot: EthercatRobot) -> None:
    robot.inject("1 al 0x001A")
    robot.inject("2 al 0x001A")
    robot.until(lambda: not robot.robot.connection.ready)
    lines: list[str] = []
    robot.robot.recover(lines.append)
    assert lines[-1].startswith("verified: 2 axes on")
    frames = robot.master.exchange.good_frames
    robot.until(lambda: robot.master.exchange.good_frames > frames + 250)
    assert robot.robot.problems == []


def test_corrupt_frames_are_counted_at_the_port_that_sees_them(robot: EthercatRobot) -> None:
    robot.inject("2 corrupt 0.2")
    fieldbus = robot.robot.fieldbus
    robot.until(lambda: fieldbus.status(0).nodes[2].extra.get("invalid_frames", 0) > 0)
    robot.inject("2 corrupt 0.0")
    fieldbus.reset_statistics(0)
    assert fieldbus.status(0).nodes[2].extra["invalid_frames"] == 0


def test_no_late_frame_is_taken_for_a_new_one_after_a_pause_of_the_bus(
    robot: EthercatRobot,
) -> None:
    """SOEM numbers its frames from 0 to 15: its values stayed 16 periods old."""
    master = robot.master
    period_ns = round(master.plan.period_s * 1e9)

    def age_ns() -> int:
        """Of the values, with a constant that does not matter."""
        return master.exchange.sent_ns - master.bus.bus_time_ns

    before_ns = age_ns()
    assert robot.device.simulation is not None
    pid = robot.device.simulation.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        robot.until(lambda: master.exchange.bad_in_row > 20)
    finally:
        os.kill(pid, signal.SIGCONT)
    good = master.exchange.good_frames
    robot.until(lambda: master.exchange.good_frames > good + 40)
    robot.until(lambda: age_ns() < before_ns + 3 * period_ns, 1.0)


def test_frames_keep_their_phase_while_the_reference_clock_drifts(robot: EthercatRobot) -> None:
    """200 ppm move the phase by a period in 20 s; the control loop follows."""
    master, phases_ns = robot.master, list[int]()
    period_ns = round(master.plan.period_s * 1e9)

    def in_the_middle() -> bool:
        """Of the last 500 frames, most: a frame may be late by chance."""
        off_ns = np.abs(np.array(phases_ns[-500:]) - period_ns // 2)
        return len(off_ns) == 500 and bool(np.median(off_ns) < period_ns / 8)

    robot.robot.control_loop.every(
        1e9 / period_ns, "phase", lambda _: phases_ns.append(master.observer.phase_ns)
    )
    robot.inject("0 drift 200")
    robot.until(lambda: len(phases_ns) > 2000)
    robot.until(in_the_middle)
    robot.until(lambda: master.observer.drift_ppm == pytest.approx(200, abs=100))


@pytest.mark.parametrize("delay_s", [0.01, 0.06, 0.3])
def test_recover_at_once_waits_for_what_follows_an_alarm(
    robot: EthercatRobot, delay_s: float
) -> None:
    """The alarm of a drive that has left Op comes with the next frame, before its AL state."""
    robot.inject("2 al 0x1B")
    robot.until(lambda: robot.image.amp_alarm[1] or robot.image.offline[1])
    MonotonicClock().sleep_until_ns(time.monotonic_ns() + round(delay_s * 1e9))
    lines: list[str] = []
    robot.robot.recover(lines.append)
    assert lines[-1].startswith("verified: 2 axes on, no alarm"), lines
    assert robot.device.state() is ConnectionState.COMMUNICATING


def test_a_slave_that_answers_complete_access_badly_is_mapped_by_plain_sdo(
    robot: EthercatRobot,
) -> None:
    connection = robot.robot.connection
    robot.inject("1 unpadded")
    with capture_logs() as lines:
        for _ in range(2):
            connection.stop_communication()
            connection.start_communication()
    (warning,) = [line for line in lines if line["event"].startswith("no complete access")]
    assert warning["slaves"] == ["axis 2 (slave 1)"]
    assert "the object does not exist" in warning["reason"]
    assert robot.device.state() is ConnectionState.COMMUNICATING


@pytest.mark.parametrize(("fault", "end"), [("trip 0x8611", "heal"), ("off", "on")])
def test_a_client_that_commands_on_moves_nothing_after_the_recovery(
    robot: EthercatRobot, fault: str, end: str
) -> None:
    check_recovery(
        robot.robot, lambda: robot.inject(f"2 {fault}"), lambda: robot.inject(f"2 {end}")
    )


def test_the_end_names_the_drives_behind_a_cut() -> None:
    with started() as robot:
        names = robot.robot.axes.names
        assert robot.image.servo_on[:2].all()
        robot.inject("2 cut")
        robot.until(lambda: robot.image.offline[1])
        assert robot.robot.shutdown() == list(names[:2])
    with started() as robot:
        assert robot.robot.shutdown() == []
