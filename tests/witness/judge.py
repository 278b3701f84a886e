"""Judge of what one drive executes; it knows the limits, and nothing of the master.

A drive, or a tap on a drive model, hands over each command that the drive executes. A silence is a
time in which the drive has executed none: it holds where the last one had led it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

VELOCITY_MARGIN = 1.2
ACCELERATION_MARGIN = 1.5
MAX_AGE_PERIODS = 3
KEPT_COMMANDS = 50
KNOWN_PERIODS = 3.5  # after an answer that was lost, until which a drive may be held
UNDER_WAY = 2.4  # periods of a ramp in one: two are sent before the first answer is missing
SILENT_PERIODS = 1.5  # between two commands: more is a silence
MAX_PULL_RAD = 0.2  # the load of a joint sinks by 0.15 before it has torque, and on meanwhile
MAX_SEED_RAD = 0.07  # 0.05 that a joint may move unnoticed, and the travel of a hand in a period
REST_RAD_S = 0.05  # what may remain of a motion after a stop
ROUNDING = 3e-6  # rad: counts of most encoders here, and floats


@dataclass(frozen=True)
class Command:
    """What a drive was commanded in one cycle.

    Attributes:
        time_s: of the cycle.
        target: position of a position mode, in rad; velocity of a velocity mode, in rad/s; torque.
        kind: "position", "velocity" or "torque".
        sent_s: when the frame was sent at which the drive executes it: SYNC, for example.
        data_s: when its target was sent. A drive may have kept it through a silence.
        place: where the drive's own demand was before: a first command begins there. Of a velocity
            mode its speed.
        word, mode: controlword and mode of operation, of drives that have them.
    """

    time_s: float
    target: float
    kind: str = "position"
    sent_s: float | None = None
    data_s: float | None = None
    place: float | None = None
    word: int = 0
    mode: int = 0


@dataclass
class Peaks:
    """The most that was asked of the drive, in rad/s and rad/s²."""

    velocity: float = 0.0
    acceleration: float = 0.0
    after_silence: float = 0.0  # rad/s, of a first command after a silence


@dataclass
class Judge:
    """Judges the commands of one axis.

    Args:
        name: of the axis, in the findings.
        velocity, acceleration, torque: limits of the joint, in its units.
        period_s: of the cycle.
        lower, upper: position limits, for targets.

    Attributes:
        may_enable: a request to switch on is being carried out.
        must_rest: all motion was stopped, and nothing has released it since.
        rest_s: time from which no velocity is commanded any more; infinite: not known.
        judges_age: commands may not be older than ``max_age_periods``; False: the network under
            test holds frames up by itself.
        may_wait: so many commands in a row may be older, if each is the successor of the one that
            was executed before: the master sends them before it can know that they will wait.
        coast_s: for so long a joint goes on as before without commands, by its last torque.
        may_catch: it was let go for a hand: a stop may switch it on again, once.
        max_jitter: of the time between two commands, in periods; where it is more, their change
            is not judged, nor that of the next one: the drive's own ramp is between.
        repeats_until_s: a target may come twice until then, and changes are not judged: periods
            have another grid, or two threads without a common clock another order.
        rounding: rad, of a target; counts of the encoders.
        speed_rounding: rad/s, of the speed register of a drive that plans its motions.
        findings: what was wrong, in order.
        commands: those executed last.
    """

    name: str
    velocity: float
    acceleration: float
    period_s: float
    torque: float = float("inf")
    lower: float = float("-inf")
    upper: float = float("inf")
    may_enable: bool = False
    must_rest: bool = False
    rest_s: float = float("inf")
    judges_age: bool = True
    max_age_periods: float = MAX_AGE_PERIODS
    may_wait: int = 0
    coast_s: float = 0.0
    may_catch: bool = False
    max_jitter: float = float("inf")
    repeats_until_s: float = float("-inf")
    rounding: float = ROUNDING
    speed_rounding: float = 0.0
    findings: list[str] = field(default_factory=list)
    peaks: Peaks = field(default_factory=Peaks)
    commands: list[Command] = field(default_factory=list)
    is_on: bool = False
    _last: Command | None = None
    _rate: float | None = None  # velocity that the last two commands ask for; None: after a silence
    _unanswered_s: float = float("-inf")  # time of the last command whose answer was lost
    _frame_s: float | None = None  # when the target that the drive got last was sent
    _irregular: bool = False  # the last command was: a target may come twice after it
    _waited: int = 0  # the last commands, so many in a row, were too old
    _braking: tuple[float, float] = (0.0, 0.0)  # a hard ramp that was asked for, and its end

    def power(self, time_s: float, on: bool) -> None:
        """Note that the power stage is on or off."""
        if on == self.is_on:
            return
        self.is_on = on
        self.own_ramp()
        if on and not self.may_enable and not self.may_catch:
            self._find(time_s, "is switched on without a request")
        if on:
            self.may_catch = False

    def own_ramp(self) -> None:
        """Note that the drive moves by ramps of its own: what it is sent now moves nothing."""
        self._last, self._rate = None, None

    def note_frame(self, sent_s: float) -> None:
        """Note that the drive got a target, sent at a time, which moves nothing."""
        self._frame_s = sent_s

    def profile(self, time_s: float, speed: float) -> None:
        """Judge the speed of a motion that the drive plans by itself."""
        if abs(speed) > VELOCITY_MARGIN * self.velocity + self.speed_rounding:
            self._find(time_s, f"moves by itself with {speed:+.1f} rad/s")
        if self.must_rest and abs(speed) > REST_RAD_S:
            self._find(time_s, f"moves by itself with {speed:+.2f} rad/s after a stop")

    def pull(self, time_s: float, displacement: float) -> None:
        """Judge the distance to the target of a drive that gets torque, or more of it."""
        if abs(displacement) > MAX_PULL_RAD:
            self._find(time_s, f"gets torque {displacement:+.2f} rad away from its target")

    def seed(self, command: Command) -> None:
        """Judge a goal that a drive is given so that it holds its joint at ``place``."""
        assert command.place is not None
        displacement = command.target - command.place
        if abs(displacement) > MAX_SEED_RAD:
            self._find(command.time_s, f"is to hold {displacement:+.2f} rad away from where it is")
        self._last, self._rate = command, None

    def bounds(self, time_s: float, position: float, before: float) -> None:
        """Judge a commanded position by the limits of the joint; beyond one it may only return."""
        outwards = min(before, self.lower), max(before, self.upper)
        if not outwards[0] - self.rounding <= position <= outwards[1] + self.rounding:
            self._find(time_s, f"is commanded to {position:+.3f} rad")

    def lose_answer(self, time_s: float) -> None:
        """Note that the master gets no answer of this cycle, or a late one.

        It cannot know whether the drive gets its frames, and may hold it at the last target.
        """
        self._unanswered_s = time_s

    def allow_ramp(self, acceleration: float, until_s: float) -> None:
        """Allow the harder ramp of a quick stop that was asked for."""
        hardest, end_s = self._braking
        self._braking = max(acceleration, hardest), max(until_s, end_s)

    def may_brake(self, time_s: float) -> bool:
        """Return True during the harder ramp that ``allow_ramp`` has allowed."""
        return time_s < self._braking[1]

    def execute(self, command: Command) -> None:
        """Judge a command that the drive executes while its power stage is on."""
        self._judge_age(command)
        self._frame_s = target_sent_s(command)
        self.commands.append(command)
        del self.commands[:-KEPT_COMMANDS]
        match command.kind:
            case "position":
                self._judge_position(command)
            case "velocity":
                self._judge_velocity(command)
            case "torque":
                if abs(command.target) > self.torque * (1 + 1e-6):
                    self._find(command.time_s, f"is asked for a torque of {command.target:.2f}")
        self._last = command

    def _judge_age(self, command: Command) -> None:
        if not self.judges_age or command.sent_s is None or self._takes_away(command):
            return
        age = (command.time_s - command.sent_s) / self.period_s
        self._waited = self._waited + 1 if age > self.max_age_periods + 0.01 else 0
        if self._waited > self.may_wait or (self._waited and not self._is_next(command)):
            self._find(command.time_s, f"executes what was sent {age:.1f} periods ago")

    def _takes_away(self, command: Command) -> bool:
        """Return True for a lower velocity, which may come at any time."""
        last = self._last
        if command.kind != "velocity" or last is None or last.kind != "velocity":
            return False
        return min(last.target, 0.0) <= command.target <= max(last.target, 0.0)

    def _is_next(self, command: Command) -> bool:
        """Return whether a target was sent after that of the frame before, with none between.

        A period may bring none, at the end of a stream.
        """
        before_s, sent_s = self._frame_s, target_sent_s(command)
        assert sent_s is not None
        return before_s is not None and sent_s - before_s < (SILENT_PERIODS + 1) * self.period_s

    def _judge_position(self, command: Command) -> None:
        last = self._last if self._last and self._last.kind == "position" else None
        before = last.target if last else command.place
        if before is None:
            self._rate = None
            return
        self.bounds(command.time_s, command.target, before)
        slack = self.rounding / self.period_s
        silence_s = silence_between(last, command)
        silent = silence_s > SILENT_PERIODS * self.period_s
        coasted_s = min(silence_s, self.coast_s) if silent else 0.0
        rate = (command.target - before) / max(self.period_s, coasted_s)
        self.peaks.velocity = max(self.peaks.velocity, abs(rate))
        if silent:
            self.peaks.after_silence = max(self.peaks.after_silence, abs(rate))
        if abs(rate) > VELOCITY_MARGIN * self.velocity + slack:
            after = f", after a silence of {silence_s:.3f} s" if silent else ""
            text = f"target steps by {command.target - before:+.4f} rad in a period"
            self._find(command.time_s, f"{text}: {rate:+.1f} rad/s{after}")
        if self.must_rest and abs(rate) > REST_RAD_S + slack:
            self._find(command.time_s, f"is moved with {rate:+.2f} rad/s after a stop")
        irregular = last and abs(command.time_s - last.time_s - self.period_s) > (
            self.max_jitter * self.period_s
        )
        was_irregular, self._irregular = self._irregular, bool(irregular)
        repeats = command.time_s < self.repeats_until_s
        if silent or last is None or irregular or was_irregular or repeats:
            self._rate = None
            return
        self._judge_change(command.time_s, rate, slack)
        self._rate = rate

    def _judge_velocity(self, command: Command) -> None:
        """Judge a velocity. After a silence, and as the first one, it may be any lower one.

        To take away speed needs no precondition: a ramp goes on while the drive is silent. Higher
        by the steps that were under way when the silence began: nothing can prevent these.
        """
        last = self._last if self._last and self._last.kind == "velocity" else None
        self._rate = None
        target, time_s = command.target, command.time_s
        self.peaks.velocity = max(self.peaks.velocity, abs(target))
        if abs(target) > VELOCITY_MARGIN * self.velocity + self.rounding:
            self._find(time_s, f"is asked for {target:+.1f} rad/s")
        if abs(target) > REST_RAD_S and (self.must_rest or time_s > self.rest_s):
            why = "after a stop" if self.must_rest else "though nobody commands it"
            self._find(time_s, f"is asked for {target:+.2f} rad/s {why}")
        before = last.target if last else command.place
        if before is None:
            return
        silent = last is None or silence_between(last, command) > SILENT_PERIODS * self.period_s
        if silent:
            before = min(max(target, min(before, 0.0)), max(before, 0.0))
        margin = UNDER_WAY if silent and last else ACCELERATION_MARGIN
        change = (target - before) / self.period_s
        self.peaks.acceleration = max(self.peaks.acceleration, abs(change))
        if abs(change) > margin * self._hardest(time_s) + self.rounding / self.period_s:
            self._find(time_s, f"target goes from {before:+.2f} to {target:+.2f} rad/s")

    def _hardest(self, time_s: float) -> float:
        hardest, until_s = self._braking
        if time_s >= until_s:
            self._braking = 0.0, 0.0
            return self.acceleration
        return max(self.acceleration, hardest)

    def _judge_change(self, time_s: float, rate: float, slack: float) -> None:
        if self._rate is None:
            return
        unknown = time_s - self._unanswered_s < KNOWN_PERIODS * self.period_s
        if unknown and abs(rate) <= slack:
            return
        change = (rate - self._rate) / self.period_s
        self.peaks.acceleration = max(self.peaks.acceleration, abs(change))
        if abs(change) > ACCELERATION_MARGIN * self._hardest(time_s) + 2 * slack / self.period_s:
            self._find(time_s, f"velocity of the target changes by {change:+.0f} rad/s²")

    def _find(self, time_s: float, what: str) -> None:
        self.findings.append(f"{time_s:.3f} s: {self.name} {what}")


def target_sent_s(command: Command) -> float | None:
    """Return when the target of a command was sent."""
    return command.sent_s if command.data_s is None else command.data_s


def silence_between(before: Command | None, after: Command) -> float:
    """Return the time between two commands, as executed or as sent; 0 without the first."""
    if before is None:
        return 0.0
    executed_s = after.time_s - before.time_s
    if before.data_s is None or after.data_s is None:
        return executed_s
    return max(executed_s, after.data_s - before.data_s)
