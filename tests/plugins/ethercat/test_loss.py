"""Loss of frames and slaves: controlled stop, cause, and return without motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import pytest
from tests.plugins.ethercat.harness import Harness

from robotd.device.state import ConnectionState, Operation
from robotd.errors import NotReady
from robotd_ethercat.al_status import AlState
from robotd_ethercat.slave import RESET
from robotd_ethercat.soem import SlaveState


def test_single_lost_frames_stop_nothing(harness: Harness) -> None:
    harness.robot.axes._driver.begin_stream([0, 1])
    harness.bus.lost_frames = 4
    harness.robot.step(5)
    assert harness.image.operation[0] == Operation.STREAM
    assert harness.master.exchange.counters.lost == 4
    assert harness.device.state() is ConnectionState.COMMUNICATING


def test_a_frame_before_late_ones_is_not_taken(harness: Harness) -> None:
    """SOEM takes a late frame for a later one of the same number."""
    exchange, bus = harness.master.exchange, harness.bus
    bus.lost_frames = 1
    harness.until(lambda: exchange.counters.lost == 1)
    bus.late_frames = 3
    good = exchange.good_frames
    harness.robot.step(1)
    assert (exchange.good_frames, exchange.counters.lost, bus.late_frames) == (good, 2, 0)
    harness.robot.step(1)
    assert exchange.good_frames == good + 1


def test_lost_frames_in_a_row_stop_all_axes(harness: Harness) -> None:
    harness.robot.axes._driver.begin_stream([0, 1])
    harness.bus.lost_frames = 6
    harness.robot.step(7)
    assert "no frame came back for 5 periods" in harness.master.supervision.faults[0]
    assert harness.device.state() is ConnectionState.UNKNOWN
    harness.until(lambda: harness.device.state() is ConnectionState.COMMUNICATING)
    assert harness.image.operation[0] != Operation.STREAM
    assert harness.image.servo_on.all()


def test_one_frame_waits_in_a_blocked_interface(harness: Harness) -> None:
    harness.robot.axes._driver.begin_stream([0, 1])
    bus = harness.bus
    bus.is_blocked, sent = True, bus.sent
    harness.robot.step(50)
    assert bus.sent == sent + 1
    text = "the network interface has sent no frame for 5 periods"
    assert text in harness.master.supervision.faults[0]
    bus.is_blocked = False
    harness.until(lambda: harness.device.state() is ConnectionState.COMMUNICATING)
    assert bus.sent > sent + 1
    assert harness.image.operation[0] != Operation.STREAM


def test_frames_that_only_the_start_has_lost_count_no_more(harness: Harness) -> None:
    """A drive that is believed not to answer gets no command."""
    exchange = harness.master.exchange
    harness.bus.lost_frames = 1
    harness.until(lambda: exchange.bad_in_row == 1)
    exchange.go_live()
    assert not any(slave.missed for slave in harness.master.slaves.values())


def test_a_slave_that_leaves_op_is_named_with_its_code(harness: Harness) -> None:
    harness.slave(1).state, harness.slave(1).code = AlState.SAFE_OP, 0x001B
    harness.robot.step(6)
    assert "working counter 7, expected 9" in harness.master.supervision.faults[0]
    harness.master.supervision.check()
    fault = harness.device.fault()
    assert "joint2 (slave 1): it went to SafeOp by itself: AL status 0x001B" in fault
    harness.robot.step(2)
    assert harness.image.offline.tolist() == [False, True]
    assert "AL status 0x001B" in harness.image.reason[1]


def test_a_slave_that_kept_its_configuration_comes_back_with_its_servo_off(
    harness: Harness,
) -> None:
    """The command follows the measured position, and nothing moves."""
    slave = harness.slave(1)
    slave.state, slave.code = AlState.SAFE_OP, 0x001B
    harness.robot.step(6)
    supervision = harness.master.supervision
    for _ in range(4):  # lost, error acknowledged, Op requested, taken back
        supervision.check()
        harness.robot.step(3)
    assert slave.state is AlState.OP
    assert harness.device.state() is ConnectionState.COMMUNICATING
    assert harness.image.servo_on.tolist() == [True, False]
    assert not harness.image.offline.any()
    assert harness.image.position_command[1] == pytest.approx(harness.image.position[1])
    harness.robot.recover()
    assert harness.image.servo_on.all()


def test_a_slave_that_is_taken_back_is_known_by_a_frame_that_it_has_processed(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    slave, exchange = harness.slave(1), harness.master.exchange
    slave.state = AlState.SAFE_OP
    harness.robot.step(6)
    harness.master.supervision.check()
    slave.state = AlState.OP
    count_online, known = exchange.count_online, []

    def later(states: Sequence[SlaveState]) -> None:
        slave.state = AlState.SAFE_OP  # again, so that the next frame passes without it
        harness.robot.step(2)
        known.append(not harness.image.offline[1])
        count_online(states)

    monkeypatch.setattr(exchange, "count_online", later)
    harness.master.supervision.check()
    assert known == [False]


def test_an_answer_that_came_too_late_loses_no_slave(harness: Harness) -> None:
    harness.robot.step(3)
    harness.bus.answers_late = True
    harness.master.supervision.check()
    assert not harness.master.supervision.lost
    assert harness.device.state() is ConnectionState.COMMUNICATING


def test_one_wrong_answer_loses_no_slave(harness: Harness) -> None:
    """The answer to another request is taken for that of the AL state, while frames are late."""
    harness.robot.axes._driver.begin_stream([0, 1])
    harness.bus.lost_frames = 4
    harness.robot.step(4)
    harness.bus.misread[1] = SlaveState(AlState.SAFE_OP, error=True, code=0x1FD)
    harness.master.supervision.check()
    harness.robot.step(3)
    assert not harness.master.supervision.faults
    assert harness.image.operation[0] == Operation.STREAM


def test_no_answer_loses_no_slave_when_one_frame_was_incomplete(harness: Harness) -> None:
    """A computer that stalls after that frame gets no answers in time."""
    harness.slave(1).state = AlState.SAFE_OP
    harness.robot.step(1)
    harness.slave(1).state = AlState.OP
    harness.bus.answers_late = True
    assert harness.master.exchange.bad_in_row == 1
    harness.master.supervision.check()
    assert not harness.master.supervision.lost


def test_a_cut_cable_loses_the_slaves_behind_it(harness: Harness) -> None:
    harness.slave(1).present = False
    harness.robot.step(6)
    harness.master.supervision.check()
    lost = [slave.name for slave in harness.master.supervision.lost]
    assert lost == ["joint2 (slave 1)", "I/O module (slave 2)"]
    assert "no answer: check its power, and the cable before it" in harness.device.fault()
    harness.robot.step(3)
    assert harness.image.offline.tolist() == [False, True]
    assert harness.master.exchange.bad_in_row == 0  # the others go on


def test_a_slave_that_is_not_in_the_descriptor_hides_no_loss(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    harness = Harness(monkeypatch, io=[])
    harness.robot.start()
    harness.slave(1).state = AlState.INIT
    harness.robot.step(6)
    assert "working counter 6, expected 9" in harness.master.supervision.faults[0]
    harness.master.supervision.check()
    harness.robot.step(3)
    assert harness.image.offline.tolist() == [False, True]
    harness.robot.shutdown()


def test_the_robot_goes_on_without_a_slave_that_is_not_in_the_descriptor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    harness = Harness(monkeypatch, io=[])
    harness.robot.start()
    harness.slave(2).present = False
    harness.robot.step(6)
    harness.master.supervision.check()
    harness.robot.step(3)
    assert harness.device.state() is ConnectionState.COMMUNICATING
    assert not harness.image.offline.any()
    harness.robot.shutdown()


def test_a_slave_that_was_reset_needs_a_new_start(harness: Harness) -> None:
    harness.slave(1).present = False
    harness.robot.step(6)
    supervision = harness.master.supervision
    supervision.check()
    harness.slave(1).power_cycle()
    harness.slave(2).power_cycle()
    supervision.check()
    supervision.check()
    assert RESET in harness.device.fault()
    harness.robot.step(200)  # the control loop finds the device not ready
    harness.robot.recover()
    assert harness.device.state() is ConnectionState.COMMUNICATING
    assert harness.image.servo_on.all()


def test_outputs_of_a_lost_module_stay_off_when_it_is_back(harness: Harness) -> None:
    harness.master.io.write_outputs(0, b"\x05")
    harness.robot.step(2)
    assert harness.slave(2).output == b"\x05\x00"
    harness.slave(2).state = AlState.SAFE_OP
    harness.robot.step(6)
    for _ in range(3):
        harness.master.supervision.check()
        harness.robot.step(2)
    assert harness.slave(2).state is AlState.OP
    assert harness.slave(2).output == b"\x00\x00"


def test_a_write_to_a_module_that_is_lost_meanwhile_is_rejected(harness: Harness) -> None:
    """It would be switched on when it is back."""
    io, lock = harness.master.io, harness.master.io._lock

    @contextmanager
    def lost_before() -> Iterator[None]:
        io._lock = lock
        harness.slave(2).state = AlState.SAFE_OP
        harness.robot.step(6)
        harness.master.supervision.check()
        with lock:
            yield

    io._lock = lost_before()  # type: ignore[assignment]
    with pytest.raises(NotReady, match="slave 2"):
        io.write_outputs(0, b"\x05")
    assert io.read_outputs(0, 1) == b"\x00"


def trip(harness: Harness, number: int) -> None:
    """A following error of a drive; returns when its emergency has been fetched."""
    drive = harness.slave(number).drive
    assert drive is not None
    drive.trip(0x8611)
    harness.until(lambda: harness.image.amp_alarm[number])
    harness.master.supervision._poll_mailbox()


def test_an_emergency_of_a_tripped_drive_is_fetched(harness: Harness) -> None:
    trip(harness, 0)
    harness.robot.step(2)
    assert "EMCY 0x8611 following error" in harness.image.reason[0]
    assert harness.image.alarm_code[0] == 0x8611
    status = harness.robot.fieldbus.status(0)
    assert "0x8611" in status.nodes[0].fault


def test_an_emergency_from_before_a_power_cycle_is_not_in_force(harness: Harness) -> None:
    trip(harness, 1)
    assert "0x8611" in harness.robot.fieldbus.status(0).nodes[1].fault
    harness.slave(1).power_cycle()
    harness.robot.step(6)
    harness.master.supervision.check()
    harness.robot.step(200)
    harness.robot.recover()
    assert harness.robot.fieldbus.status(0).nodes[1].fault == ""
