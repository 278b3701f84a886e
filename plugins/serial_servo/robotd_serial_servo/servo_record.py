"""One servo in the bus thread: what its replies say, and which positions are implausible."""

from __future__ import annotations

from dataclasses import dataclass, field

from robotd.api import NANOSECONDS
from robotd_serial_servo.calibration import RAD_PER_TICK
from robotd_serial_servo.options import PlannedServo
from robotd_serial_servo.servo_bus import TICKS_PER_TURN, Goal, ServoState
from robotd_serial_servo.servo_faults import Fault

FASTEST_TICKS_S = 10.0 / RAD_PER_TICK  # no servo turns faster; a hand rarely does
STEP_TICKS = 40  # beyond that, between two replies
CONSISTENT = 3  # replies at a place where a position has jumped to, until it is believed
LIMIT_STEP = 0.002  # resolution of a torque limit
LOST_REPLIES = (
    3  # in a row: one that is lost just after a stall of this program is not a lost servo
)
MAX_SPEED_REGISTER = 32767


@dataclass
class ServoRecord:
    """State of one servo. Bus thread, except what is named; ``releases`` is counted by anyone.

    Attributes:
        state: the newest that is believed; None before the first.
        missed: the last request had no reply that is believed: it gets no goal.
        misses: so many times in a row.
        offline: so ``LOST_REPLIES`` times, and for longer than ``lost_after_s``.
        activation: counter of the times at which the servo was switched on, or answered again. Only
            targets that were computed for the present one are sent; 0: none is.
        activations: the highest of them so far.
        goal: the last one sent or seeded, ticks; None while it gets none.
        acknowledged: the goal that the servo has shown last, ticks.
        goal_lost_ns: since when the servo shows another goal; 0: it shows that one.
        switching: it is being switched on.
        expected_on: it was switched on, and not off since.
        off_pending: it was to go off, and did not answer: it is asked again when it does.
        alarm: code, kept until it is cleared; 0: none.
        releases: requests to switch it off; one that comes while it is being switched on ends that.
        replies, lost: counts.
    """

    plan: PlannedServo
    state: ServoState | None = None
    answered_ns: int = 0
    missed: bool = True
    misses: int = 0
    offline: bool = False
    activation: int = 0
    activations: int = 0
    goal: int | None = None
    acknowledged: int | None = None
    goal_lost_ns: int = 0
    switching: bool = False
    expected_on: bool = False
    off_pending: bool = False
    alarm: int = 0
    releases: int = 0
    replies: int = 0
    lost: int = 0
    _jumped_to: list[int] = field(default_factory=list)

    @property
    def servo(self) -> int:
        """Id on the bus."""
        return self.plan.servo

    def activate(self, goal: int) -> None:
        """Take goals from now on, from ``goal`` in ticks, at which the servo holds."""
        self._renew()
        self.goal = self.acknowledged = goal
        self.goal_lost_ns, self.expected_on = 0, True

    def _renew(self) -> None:
        """Take no targets that were computed before now."""
        self.activations += 1
        self.activation = self.activations

    def deactivate(self) -> None:
        """Take no more goals: whatever was asked for is no longer sent."""
        self.activation, self.goal = 0, None

    def next_goal(self, target: float, period_s: float) -> Goal | None:
        """Return the goal to send for ``target`` in rad, NaN: none; None: send nothing.

        It follows the target no faster than the joint may move, also after a silence: the last
        line of defence.
        """
        if not self.activation or self.missed or self.goal is None:
            return None
        plan, before = self.plan, self.goal
        if target == target:  # noqa: PLR0124 - not NaN
            low, high = plan.range_ticks
            wanted = min(max(plan.scale.ticks(target), low), high)
            step = int(plan.max_speed * period_s) + 1
            self.goal = min(max(wanted, before - step), before + step)
        return Goal(self.goal, self.speed_limit)

    @property
    def speed_limit(self) -> int:
        """Highest speed of the servo on the way to a goal, ticks/s."""
        return max(1, min(round(self.plan.max_speed), MAX_SPEED_REGISTER))

    def miss(self, now_ns: int, lost_after_s: float) -> None:
        """Count a missing reply."""
        self.missed, self.misses = True, self.misses + 1
        self.lost += not self.offline
        if self.activation:
            self._renew()
        silent_s = (now_ns - self.answered_ns) / NANOSECONDS
        if self.misses >= LOST_REPLIES and silent_s > lost_after_s:
            self.offline = True

    def take(self, state: ServoState, now_ns: int, lost_after_s: float) -> bool:
        """Judge a reply; True: the servo is on without a request and has to be switched off."""
        before, self.replies = self.state, self.replies + 1
        if before is not None and self._is_doubtful(before, state):
            self.miss(now_ns, lost_after_s)
            return False
        if self.missed and self.activation:
            self._renew()
        self.missed, self.misses, self.offline = False, 0, False
        self.state, self.answered_ns = state, now_ns
        if state.error:
            self.raise_alarm(state.error)
        if state.expired:
            self.raise_alarm(Fault.EXPIRED)
        if self.activation:
            self._check_active(state, now_ns, lost_after_s)
        if state.torque and not self.expected_on and not self.switching:
            self.raise_alarm(self.alarm or Fault.SWITCHED_ON)
            return True
        return False

    def raise_alarm(self, code: int) -> None:
        """Keep an alarm; fault bits of the servo add up. Goals end, the drive stays as it is."""
        if not self.alarm or (self.alarm < Fault.RESTARTED and code < Fault.RESTARTED):
            self.alarm |= code
        self.deactivate()

    def _check_active(self, state: ServoState, now_ns: int, lost_after_s: float) -> None:
        """Compare what the servo shows with what it was sent.

        Of a goal that was lost the servo shows the one before, as in a reply that comes late: the
        goal is kept, so that none leads back. Goal and torque limit are lost with the power.
        """
        kept = state.goal in (self.goal, self.acknowledged)
        limited = abs(state.torque_limit - self.plan.torque_limit) <= LIMIT_STEP
        if state.restarted or not limited or not state.torque:
            own = kept and limited and not state.restarted
            self.raise_alarm(Fault.SWITCHED_OFF if own else Fault.RESTARTED)
            self.expected_on = False
        elif state.goal == self.goal:
            self.acknowledged, self.goal_lost_ns = state.goal, 0
        else:
            self.goal_lost_ns = self.goal_lost_ns or now_ns
            if now_ns - self.goal_lost_ns > lost_after_s * NANOSECONDS:
                self.raise_alarm(Fault.GOAL_LOST)
            elif kept:  # it is sent once more, and nothing beyond it
                self._renew()
            else:  # of another program; or of a reply that came late
                self.missed = True

    def _is_doubtful(self, before: ServoState, state: ServoState) -> bool:
        """Return whether the position is implausible: outside the turn, or a jump."""
        elapsed_s = (state.time_ns - before.time_ns) / NANOSECONDS
        near = STEP_TICKS + FASTEST_TICKS_S * elapsed_s
        inside = 0 <= state.position < TICKS_PER_TURN
        if inside and abs(state.position - before.position) <= near:
            self._jumped_to.clear()
            return False
        self._jumped_to.append(state.position)
        latest = self._jumped_to[-CONSISTENT:]
        if len(latest) < CONSISTENT or max(latest) - min(latest) > near:
            return True
        self._jumped_to.clear()
        if not inside:
            self.raise_alarm(Fault.OUT_OF_TURN)
        elif self.activation:
            self.raise_alarm(Fault.JUMPED)
        return False
