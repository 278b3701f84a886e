"""Switch a servo on without a jump, off for sure, and clear its alarm: steps of the bus thread.

Each ``yield`` lets one exchange pass, so that the other servos go on.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial

from robotd.api import NANOSECONDS, Clock, DeviceTimeout, NotReady, OperationError
from robotd_serial_servo.calibration import RAD_PER_TICK
from robotd_serial_servo.servo_bus import TICKS_PER_TURN, BusError, Goal, ServoBus, ServoState
from robotd_serial_servo.servo_record import ServoRecord

MOVED_TICKS = 30  # 0.05 rad, more than the play of a gear, while a servo is switched on
RAISED_TICKS = 100  # 0.15 rad: as far as a load may sink while its servo has no torque yet
RAMP = (0.1, 0.25, 0.5, 1.0)  # of the torque limit
STILL_TICKS, STILL_REPLIES = 3, 5  # between two replies, and so many in a row: it is at rest
OUTSIDE_TICKS = 100  # beyond the calibrated range
OFF_TRIES = 5
Steps = Generator[None]


def energise(bus: ServoBus, record: ServoRecord, clock: Clock, deadline_ns: int) -> Steps:
    """Switch on at the measured position: goal first, no torque, then more and more of it."""
    if record.activation:
        return
    record.off_pending = False
    releases = record.releases
    yield from _reply(record, clock, deadline_ns)
    goal = _goal_here(record)
    record.switching = True
    try:
        yield from _seed(bus, record, goal, clock, deadline_ns, releases)
        _require_still(record, goal, MOVED_TICKS)
        for part in RAMP:
            bus.limit_torque(record.servo, part * record.plan.torque_limit)
            yield
            yield from _reply(record, clock, deadline_ns)
            _require_no_release(record, releases)
            _require_still(record, goal, RAISED_TICKS)
        record.activate(goal.position)
    except BaseException:
        _off(bus, record)
        raise
    finally:
        record.switching = False
    yield  # until the exchange has shown it


def catch(
    bus: ServoBus, record: ServoRecord, clock: Clock, deadline_ns: int, releases: int
) -> Steps:
    """Switch on a servo whose arm is moved by a hand or by its weight; hold it where it rests.

    As ``energise``, but a joint that moves on takes its goal along: no goal is further away than
    ``MOVED_TICKS``, so that the servo brakes, and never pulls back.

    ``releases``: of the record when it was asked for: a servo that was to go off meanwhile stays
    off.
    """
    if record.activation:
        return
    record.off_pending = False
    yield from _reply(record, clock, deadline_ns)
    _require_no_release(record, releases)
    goal = _goal_here(record)
    record.switching = True
    try:
        yield from _seed(bus, record, goal, clock, deadline_ns, releases)
        parts, before, still = list(RAMP), goal.position, 0
        while parts or still < STILL_REPLIES:
            _require_time(clock, deadline_ns)
            position = _known(record).position
            still = still + 1 if abs(position - before) <= STILL_TICKS else 0
            before = position
            if abs(position - goal.position) > MOVED_TICKS:
                goal = _goal_here(record)
                bus.seed(record.servo, goal)
            if parts:
                bus.limit_torque(record.servo, parts.pop(0) * record.plan.torque_limit)
            yield
            yield from _reply(record, clock, deadline_ns + NANOSECONDS)
            _require_no_release(record, releases)
        record.activate(goal.position)
    except BaseException:
        _off(bus, record)
        raise
    finally:
        record.switching = False
    yield  # until the exchange has shown it


def _seed(
    bus: ServoBus, record: ServoRecord, goal: Goal, clock: Clock, deadline_ns: int, releases: int
) -> Steps:
    """Switch on at ``goal``, without torque. Raises OperationError: the servo does not show it."""
    steps: tuple[Callable[[], None], ...] = (
        partial(bus.limit_torque, record.servo, 0.0),
        # On STS this switches on: with a torque limit of 0 nothing moves.
        partial(bus.seed, record.servo, goal),
        partial(bus.set_torque, record.servo, on=True),
    )
    for step in steps:
        step()
        yield
        yield from _reply(record, clock, deadline_ns)
        _require_no_release(record, releases)
    _require_seeded(_known(record), goal)


def release(bus: ServoBus, record: ServoRecord) -> Steps:
    """Switch off; no goal follows, for a goal would switch on again."""
    record.deactivate()
    _off(bus, record)
    yield


def clear(bus: ServoBus, record: ServoRecord, clock: Clock, deadline_ns: int) -> Steps:
    """Clear an alarm: the servo is off then, and nothing moves."""
    if not record.alarm:
        return
    record.deactivate()
    _off(bus, record)
    bus.try_to_clear(record.servo)
    yield
    while record.missed or record.state is None or record.state.error:
        if clock.now_ns() > deadline_ns:
            raise DeviceTimeout("the fault is still there: switch the supply off and on")
        yield
    record.alarm = 0
    yield


def _reply(record: ServoRecord, clock: Clock, deadline_ns: int) -> Steps:
    """Wait for the next reply of a servo that is not offline: a lost one ends nothing."""
    while record.missed and not record.offline:
        yield
    if clock.now_ns() > deadline_ns:
        raise DeviceTimeout("the servo did not go on in time")


def _off(bus: ServoBus, record: ServoRecord) -> None:
    tries = 1 if record.offline else OFF_TRIES  # each delays the others
    for attempt in range(tries):
        try:
            bus.set_torque(record.servo, on=False)
        except BusError:
            if attempt == tries - 1:
                record.off_pending = True
                raise
        else:
            record.expected_on = record.off_pending = False
            return


def _known(record: ServoRecord) -> ServoState:
    """Return the present state. Raises NotReady."""
    if record.state is None or record.missed:
        raise NotReady("its position is not known: the servo does not answer")
    if record.alarm:
        raise NotReady("the servo is in alarm")
    return record.state


def _goal_here(record: ServoRecord) -> Goal:
    """Return the goal where the servo is. Raises NotReady: that is not known, or not plausible."""
    position = _known(record).position
    _require_plausible(record, position)
    return Goal(position, record.speed_limit)


def _require_plausible(record: ServoRecord, position: int) -> None:
    low, high = record.plan.range_ticks
    if not 0 <= position < TICKS_PER_TURN:
        raise NotReady(f"position {position} is not within one turn: the servo is miscounting")
    if not low - OUTSIDE_TICKS <= position <= high + OUTSIDE_TICKS:
        text = f"position {position} is outside of its calibrated range {low} to {high}"
        raise NotReady(f"{text}: turn the joint back by hand, or calibrate again")


def _require_seeded(state: ServoState, goal: Goal) -> None:
    if state.goal != goal.position or not state.torque or state.torque_limit > 0.0:
        text = f"goal {state.goal} instead of {goal.position}, torque {int(state.torque)}"
        limit = f"a torque limit of {100 * state.torque_limit:.0f} % instead of 0"
        raise OperationError(f"the servo shows {text}, or {limit}")


def _require_still(record: ServoRecord, goal: Goal, ticks: int) -> None:
    moved = abs(_known(record).position - goal.position)
    if moved > ticks:
        text = f"the joint moved by {moved * RAD_PER_TICK:.2f} rad while it was switched on"
        raise OperationError(f"{text}: hold the arm still, support it, and try again")


def _require_time(clock: Clock, deadline_ns: int) -> None:
    if clock.now_ns() > deadline_ns:
        raise OperationError("the joint was moved on: hold it still, and switch it on")


def _require_no_release(record: ServoRecord, releases: int) -> None:
    if record.releases != releases:
        raise OperationError("switched off before the servo was on")
