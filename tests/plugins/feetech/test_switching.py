"""On without a jump, off for sure, and what a servo does by itself, exchange by exchange."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.fakes import FakeClock
from tests.plugins.feetech.fake_bus import FakeServo, FakeServoBus

from robotd.api import NotReady, OperationError, RobotdError
from robotd_serial_servo.calibration import Scale
from robotd_serial_servo.exchange import SEARCH_PERIODS, Exchange, Job
from robotd_serial_servo.options import PlannedServo
from robotd_serial_servo.serial_port import PortLost
from robotd_serial_servo.servo_faults import Fault
from robotd_serial_servo.servo_record import ServoRecord
from robotd_serial_servo.switching import MOVED_TICKS, catch, clear, energise

PERIOD_S = 0.01
MAX_SPEED = 1000.0  # ticks/s
SCALE = Scale(2048.0)


class Bench:
    """An exchange whose thread is this one."""

    def __init__(self, *servos: FakeServo, limit: float = 0.8) -> None:
        self.clock = FakeClock()
        self.servos = servos
        self.bus = FakeServoBus(self.clock, dict(enumerate(servos, 1)))
        plans = [
            PlannedServo(axis, f"joint{axis}", axis + 1, None, SCALE, None, limit, MAX_SPEED)
            for axis in range(len(servos))
        ]
        self.exchange = Exchange(self.bus, plans, self.clock, PERIOD_S, 0.15, 0)
        self.targets = np.full(len(servos), np.nan)
        self.periods(1)

    @property
    def record(self) -> ServoRecord:
        return self.exchange.records[0]

    def periods(self, count: int) -> None:
        for _ in range(count):
            self.exchange.send(self.targets, self.exchange.feedback.activation)
            self.exchange._exchange()
            self.clock.advance(PERIOD_S)
            self.exchange._work(self.clock.now_ns())

    def on(self, axis: int = 0) -> Job:
        record, deadline_ns = self.exchange.records[axis], self.clock.now_ns() + 10**9
        return self.finish(
            self.exchange.submit(energise(self.bus, record, self.clock, deadline_ns))
        )

    def off(self, axis: int = 0) -> Job:
        return self.finish(self.exchange.switch_off(axis))

    def catch(self, for_s: float = 3.0) -> Job:
        record, deadline_ns = self.record, self.clock.now_ns() + round(for_s * 1e9)
        steps = catch(self.bus, record, self.clock, deadline_ns, record.releases)
        return self.exchange.submit(steps)

    def lead(self, ticks: int, periods: int) -> None:
        """Move the first servo by hand in each period, whatever its torque."""
        for _ in range(periods):
            self.servos[0].held = True
            self.servos[0].position += ticks
            self.periods(1)
        self.servos[0].held = False

    def clear(self) -> Job:
        deadline_ns = self.clock.now_ns() + 10**9
        return self.finish(
            self.exchange.submit(clear(self.bus, self.record, self.clock, deadline_ns))
        )

    def finish(self, job: Job) -> Job:
        for _ in range(300):
            if job.done.is_set():
                return job
            self.periods(1)
        raise AssertionError("the job does not end")

    def move(self, ticks: int) -> None:
        self.targets[0] = SCALE.angle(ticks)


def test_a_servo_goes_on_where_it_stands_though_its_goal_is_at_the_end() -> None:
    servo = FakeServo(position=1234, goal=0)
    bench = Bench(servo)
    assert bench.on().error is None
    assert servo.torque
    assert servo.limit == 0.8
    assert servo.jumps == []
    names = [call[0] for call in bench.bus.calls]
    assert names[:3] == ["limit", "seed", "torque"]
    assert bench.bus.calls[0] == ("limit", 1, 0.0)


def test_a_hand_that_moves_the_arm_meanwhile_is_noticed() -> None:
    servo = FakeServo(position=1234)
    bench = Bench(servo)
    deadline_ns = bench.clock.now_ns() + 10**9
    job = bench.exchange.submit(energise(bench.bus, bench.record, bench.clock, deadline_ns))
    bench.periods(2)
    servo.position += 60
    bench.finish(job)
    with pytest.raises(OperationError, match=r"moved by 0.09 rad while it was switched on"):
        bench.exchange.wait(job, 0.0)
    assert not servo.torque
    assert servo.jumps == []


@pytest.mark.parametrize("position", [-3, 4100])
def test_a_position_beyond_one_turn_is_refused(position: int) -> None:
    servo = FakeServo(position=position)
    bench = Bench(servo)
    assert isinstance(bench.on().error, NotReady)
    assert not any(call[0] == "seed" for call in bench.bus.calls)


def test_no_goal_follows_a_servo_off() -> None:
    servo = FakeServo()
    bench = Bench(servo)
    bench.on()
    bench.move(2300)
    bench.periods(3)
    bench.off()
    bench.bus.calls.clear()
    bench.periods(20)
    assert bench.bus.calls == []
    assert not servo.torque


def test_targets_of_before_are_not_sent_after_the_next_servo_on() -> None:
    servo = FakeServo()
    bench = Bench(servo)
    bench.on()
    bench.move(2100)
    bench.periods(20)
    old = bench.exchange.feedback.activation
    bench.off()
    servo.position = 1000
    bench.periods(2)
    deadline_ns = bench.clock.now_ns() + 10**9
    job = bench.exchange.submit(energise(bench.bus, bench.record, bench.clock, deadline_ns))
    while not job.done.is_set():  # a control loop that has not seen any of it
        bench.exchange.send(bench.targets, old)
        bench.exchange._exchange()
        bench.clock.advance(PERIOD_S)
        bench.exchange._work(bench.clock.now_ns())
    assert servo.goal == 1000
    assert servo.position == 1000


def test_a_target_that_jumps_is_followed_at_the_joints_speed() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    bench.on()
    bench.move(4000)
    bench.periods(10)
    assert max(servo.jumps) <= MAX_SPEED * PERIOD_S + 1
    assert servo.position == pytest.approx(2000 + 10 * MAX_SPEED * PERIOD_S, abs=12)


def test_a_silent_servo_gets_no_goal_and_goes_on_from_the_last_one_that_it_had() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    bench.on()
    bench.move(2500)
    bench.periods(5)
    before, servo.jumps = servo.position, []
    servo.silent = True
    bench.periods(1)
    bench.bus.calls.clear()
    bench.periods(8)
    assert bench.exchange.feedback.silent[0]
    assert bench.bus.calls == []
    servo.silent = False
    bench.periods(2)
    assert not bench.exchange.feedback.silent[0]
    assert 0 < servo.position - before <= 2 * (PERIOD_S * MAX_SPEED + 1)
    assert bench.record.alarm == 0


def test_a_goal_that_was_lost_on_the_way_is_not_skipped_over() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    bench.on()
    bench.move(2500)
    bench.periods(5)
    servo.jumps.clear()
    servo.deaf = True
    bench.periods(4)
    servo.deaf = False
    bench.periods(3)
    assert max(servo.jumps) <= MAX_SPEED * PERIOD_S + 1
    assert bench.record.alarm == 0


def test_a_goal_that_a_late_reply_does_not_show_yet_is_not_taken_back() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    bench.on()
    bench.move(2500)
    bench.periods(5)
    sent, shown = bench.record.goal, bench.record.acknowledged
    assert sent is not None
    assert shown is not None
    assert shown < sent
    servo.goal = shown
    bench.exchange._exchange()
    assert servo.goal == bench.record.goal == sent
    assert bench.exchange.feedback.silent[0]
    assert bench.exchange.feedback.goal[0] == SCALE.angle(sent)


def test_targets_of_before_a_lost_reply_are_not_sent_after_it() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    bench.on()
    bench.move(2100)
    bench.periods(20)
    old = bench.exchange.feedback.activation
    servo.silent = True
    bench.exchange._exchange()
    servo.silent = False
    bench.move(2000)
    bench.exchange.send(bench.targets, old)  # a control loop that has not seen it
    bench.exchange._exchange()
    assert servo.goal == 2100
    bench.periods(1)
    assert servo.goal < 2100


def test_a_lost_port_ends_all_jobs_also_one_that_would_switch_off_at_its_end() -> None:
    bench = Bench(FakeServo(), FakeServo())
    first, last = bench.catch(), bench.exchange.switch_off(1)
    bench.exchange._work(bench.clock.now_ns())

    def lost(servo: int, *, on: bool) -> None:
        raise PortLost("the port")

    bench.bus.set_torque = lost  # type: ignore[method-assign]
    bench.exchange._fail("the port")
    assert first.done.is_set()
    assert last.done.is_set()


def test_a_bus_that_is_closed_ends_its_jobs_while_the_port_is_open() -> None:
    servo = FakeServo(held=True)
    bench = Bench(servo)
    job = bench.catch()
    bench.exchange._work(bench.clock.now_ns())
    bench.exchange._exchange()
    assert not job.done.is_set()
    bench.exchange._ends = True
    bench.exchange._run()
    assert job.done.is_set()
    assert bench.bus.calls[-1] == ("torque", 1, False)


def _restart(servo: FakeServo) -> None:
    servo.restart()


def _switch_off(servo: FakeServo) -> None:
    servo.torque = False


def _foreign_goal(servo: FakeServo) -> None:
    servo.goal += 500


def _jump(servo: FakeServo) -> None:
    servo.position, servo.held = servo.position + 900, True


def _overload(servo: FakeServo) -> None:
    servo.error = 0x20


@pytest.mark.parametrize(
    ("event", "alarm"),
    [
        (_restart, Fault.RESTARTED),
        (_switch_off, Fault.SWITCHED_OFF),
        (_foreign_goal, Fault.GOAL_LOST),
        (_jump, Fault.JUMPED),
        (_overload, 0x20),
    ],
)
def test_what_happens_to_a_servo_is_named_and_ends_its_goals(
    event: Callable[[FakeServo], None], alarm: int
) -> None:
    servo = FakeServo()
    bench = Bench(servo)
    bench.on()
    bench.move(2100)
    bench.periods(2)
    event(servo)
    bench.periods(20)
    assert bench.exchange.feedback.alarm[0] == alarm
    servo.jumps.clear()
    bench.bus.calls.clear()
    bench.periods(20)
    assert not any(call[0] in {"goal", "seed"} for call in bench.bus.calls)
    assert isinstance(bench.on().error, NotReady)
    bench.targets[0] = np.nan
    assert bench.clear().error is None
    assert not servo.torque
    servo.position, servo.held = 1500, False
    servo.jumps.clear()
    bench.periods(2)
    # The position has jumped by hand: it is believed after some replies.
    bench.periods(3)
    assert bench.on().error is None
    assert servo.position == 1500
    assert servo.jumps == []


def test_a_power_loss_longer_than_the_silence_is_a_restart_as_well() -> None:
    servo, other = FakeServo(), FakeServo()
    bench = Bench(servo, other)
    bench.on(0)
    bench.on(1)
    servo.silent = True
    bench.periods(20)
    assert bench.exchange.feedback.offline.tolist() == [True, False]
    assert not bench.exchange.feedback.torque[0]
    servo.restart()
    servo.silent = False
    bench.periods(45)
    assert not bench.exchange.feedback.offline[0]
    assert bench.exchange.feedback.alarm.tolist() == [Fault.RESTARTED, 0]
    assert servo.jumps == []


def test_a_reply_that_is_lost_after_a_stall_is_no_lost_servo() -> None:
    bench = Bench(FakeServo())
    bench.clock.advance(0.5)
    bench.servos[0].silent = True
    bench.periods(2)
    assert not bench.exchange.feedback.offline[0]
    bench.periods(1)
    assert bench.exchange.feedback.offline[0]


@pytest.mark.parametrize("missing", [0, 3])
def test_an_arm_whose_supply_was_away_is_back_at_once(missing: int) -> None:
    servos = [FakeServo() for _ in range(6)]
    bench = Bench(*servos)
    for servo in servos:
        servo.silent = True
    bench.periods(30)
    assert bench.exchange.feedback.offline.all()
    for servo in servos[:missing] + servos[missing + 1 :]:
        servo.silent = False
    bench.periods(2 * SEARCH_PERIODS)
    assert bench.exchange.feedback.offline.tolist() == [number == missing for number in range(6)]
    servos[missing].silent = False
    bench.periods(SEARCH_PERIODS)
    assert not bench.exchange.feedback.offline.any()


def test_a_servo_that_comes_on_by_itself_is_switched_off() -> None:
    servo = FakeServo()
    bench = Bench(servo)
    servo.goal, servo.torque = servo.position, True
    bench.periods(3)
    assert not servo.torque
    assert bench.exchange.feedback.alarm[0] == Fault.SWITCHED_ON


def test_off_ends_what_switches_on() -> None:
    servo = FakeServo()
    bench = Bench(servo)
    deadline_ns = bench.clock.now_ns() + 10**9
    job = bench.exchange.submit(energise(bench.bus, bench.record, bench.clock, deadline_ns))
    bench.periods(4)
    bench.off()
    bench.finish(job)
    with pytest.raises(OperationError, match="switched off before"):
        bench.exchange.wait(job, 0.0)
    bench.periods(5)
    assert not servo.torque


def test_off_of_a_silent_servo_is_not_claimed() -> None:
    servo = FakeServo()
    bench = Bench(servo)
    bench.on()
    servo.silent = True
    bench.periods(20)
    job = bench.off()
    with pytest.raises(RobotdError, match="does not answer"):
        bench.exchange.wait(job, 0.0)


def test_a_servo_that_was_to_go_off_in_a_silence_goes_off_when_it_answers() -> None:
    bench = Bench(FakeServo(), FakeServo())
    bench.on(0)
    bench.on(1)
    bench.servos[0].silent = True
    bench.periods(2)
    assert isinstance(bench.off().error, RobotdError)
    bench.periods(SEARCH_PERIODS * 3)
    assert bench.servos[0].torque
    bench.servos[0].silent = False
    bench.periods(SEARCH_PERIODS * 3)
    assert not bench.servos[0].torque
    assert bench.servos[1].torque
    assert not bench.record.alarm


def test_an_off_that_nobody_waits_for_any_more_is_executed() -> None:
    bench = Bench(FakeServo())
    bench.on()
    job = bench.exchange.switch_off(0)
    with pytest.raises(RobotdError, match="did not get to it"):
        bench.exchange.wait(job, 0.0)
    bench.periods(2)
    assert not bench.servos[0].torque


def test_switching_on_again_replaces_an_off_that_failed() -> None:
    bench = Bench(FakeServo())
    bench.on()
    bench.servos[0].silent = True
    bench.periods(2)
    bench.off()
    bench.servos[0].silent = False
    job = bench.on()
    assert job.error is None
    bench.periods(5)
    assert bench.servos[0].torque


def test_a_servo_that_a_hand_moves_on_takes_its_goal_along_and_is_held_at_the_end() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    bench.on()
    bench.off()
    job, behind = bench.catch(), []
    for _ in range(40):
        bench.lead(8, 1)
        if servo.torque and servo.limit:
            behind.append(abs(servo.goal - servo.position))
    assert not job.done.is_set()
    assert len(behind) > 20
    assert max(behind) <= MOVED_TICKS + 2 * 8
    assert bench.finish(job).error is None
    assert bench.record.activation
    assert servo.torque
    assert sum(map(abs, servo.jumps)) <= MOVED_TICKS + 2 * 8
    assert servo.position == pytest.approx(2320, abs=MOVED_TICKS + 2 * 8)


def test_a_servo_at_rest_is_caught_where_it_is() -> None:
    servo = FakeServo(position=1234)
    bench = Bench(servo)
    assert bench.finish(bench.catch()).error is None
    assert (servo.position, servo.goal, servo.torque, servo.jumps) == (1234, 1234, True, [])
    assert servo.limit == pytest.approx(0.8)


def test_a_servo_that_is_pushed_on_and_on_goes_off_and_says_why() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    job = bench.catch(for_s=0.5)
    bench.lead(8, 100)
    assert job.done.is_set()
    with pytest.raises(OperationError, match="moved on"):
        bench.exchange.wait(job, 0.0)
    assert not servo.torque
    assert not bench.record.activation


def test_off_ends_a_catch_also_one_that_has_not_begun() -> None:
    servo = FakeServo(position=2000)
    bench = Bench(servo)
    for periods in (0, 3):
        job = bench.catch()
        bench.periods(periods)
        bench.off()
        bench.finish(job)
        with pytest.raises(OperationError, match="switched off before"):
            bench.exchange.wait(job, 0.0)
        bench.periods(5)
        assert not servo.torque
