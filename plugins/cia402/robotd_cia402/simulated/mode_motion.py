"""Modes of operation of a simulated axis."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

from robotd.api import Profile, Segment, profile_to_position, profile_to_rest, profile_to_velocity
from robotd_cia402.simulated.homing_search import METHODS, Phase, Search
from robotd_cia402.simulated.motors import Motors
from robotd_cia402.simulated.scale import Scale, Switches

_SET_POINT, _IMMEDIATE, _RELATIVE, _HALT = 1 << 4, 1 << 5, 1 << 6, 1 << 8
_HERE = (35, 37)  # homing methods that take the present position
_AT_REST = 1e-4  # rad/s
_SPAN = 1 << 32

Get = Callable[..., int]


class Mode(IntEnum):
    """Numbers of objects 0x6060 and 0x6061."""

    NONE = 0
    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10

    @classmethod
    def of(cls, number: int) -> Mode | None:
        """Return the mode of a number; None for one that the drive does not support."""
        return cls(number) if number in cls._value2member_map_ else None


class Motion:
    """Command of one motor, by mode of operation. ``get`` reads a profile object.

    Attributes:
        mode: in force; follows object 0x6060.
        target_reached, mode_bit, error_bit, limited: bits 10, 12, 13 and 11 of the statusword.
    """

    def __init__(
        self, motor: int, scale: Scale, machine: Motors, get: Get, switches: Switches
    ) -> None:
        self.mode = Mode.NONE
        self._switches = switches
        self.target_reached = self.mode_bit = self.error_bit = self.limited = False
        self._motor, self._scale, self._machine, self._get = motor, scale, machine, get
        self._zero = 0  # counts at position 0
        self._target: float | None = None  # set-point that a halt has put aside
        self._speed: float | None = None
        self._search: Search | None = None
        self._handlers = {
            Mode.PROFILE_POSITION: self._profile_position,
            Mode.PROFILE_VELOCITY: self._profile_velocity,
            Mode.HOMING: self._homing,
            Mode.INTERPOLATED_POSITION: self._interpolated_position,
            Mode.CYCLIC_POSITION: self._cyclic_position,
            Mode.CYCLIC_VELOCITY: self._cyclic_velocity,
            Mode.CYCLIC_TORQUE: self._cyclic_torque,
        }

    def counts(self, position: float) -> int:
        """Encoder counts of a motor position (not wrapped)."""
        return round(position * self._scale.position * self._scale.polarity) - self._zero

    @property
    def zero(self) -> float:
        """Motor position at which the encoder reads 0."""
        return self._to_position(0)

    def inputs(self) -> int:
        """Object 0x60FD: the switches where the motor is."""
        return self._switches.inputs(self._scale.polarity * self._machine.position(self._motor))

    def begin(self) -> None:
        """Start at rest: operation has been enabled."""
        self._target = self._speed = self._search = None
        self.target_reached, self.mode_bit, self.error_bit = True, False, False
        if not self._machine.moves(self._motor):
            self._machine.hold(self._motor, self._machine.command(self._motor)[0])

    def act(self, mode: Mode | None, before: int, word: int, period_s: float) -> None:
        """One period with the controlword ``word``; ``before`` is the last period's."""
        if mode is not None and mode is not self.mode:
            self._change(mode)
        handler = self._handlers.get(self.mode)
        if handler is not None:
            handler(word & ~before, word, period_s)

    def prepare(self, mode: Mode | None) -> None:
        """Change the mode of a drive that rests in its quick stop."""
        if mode is not None and mode is not self.mode and self._rests():
            self._change(mode)

    def quick_stop(self, then: Callable[[], None] | None = None) -> None:
        """Brake with object 0x6085 and call ``then`` at rest."""
        self._target = self._speed = self._search = None
        self._brake(self._ramp(0x6085), then)

    def _change(self, mode: Mode) -> None:
        """Change the mode; a running motion stops with the ramp of the previous mode."""
        self.mode = mode
        self._target = self._speed = self._search = None
        self.mode_bit = self.error_bit = False
        self.target_reached = True
        if self._machine.moves(self._motor) and mode is not Mode.PROFILE_VELOCITY:
            self._brake(self._ramp(0x6084))

    def _profile_position(self, rising: int, word: int, period_s: float) -> None:
        if rising & _SET_POINT:
            target = self._unwrapped(self._get(0x607A))
            if word & _RELATIVE:
                target = self._machine.command(self._motor)[0] + self._relative()
            self._target, self.mode_bit, self.target_reached = target, True, False
            if not word & _HALT:
                self._move(target)
        elif not word & _SET_POINT:
            self.mode_bit = False
        if word & _HALT:
            if self._speed is None:
                self._speed = 0.0  # marks the halt
                self.target_reached = False
                self._brake(self._ramp(0x6084))
            self.target_reached = self._rests()
        elif self._speed is not None:
            self._speed = None
            if self._target is not None:
                self._move(self._target)
        elif self._target is not None:
            self.target_reached = not self._machine.moves(self._motor)

    def _profile_velocity(self, rising: int, word: int, period_s: float) -> None:
        sign, unit = self._scale.polarity, self._scale.velocity
        speed = 0.0 if word & _HALT else self._get(0x60FF) / unit * sign
        if speed != self._speed:
            self._speed = speed
            position, velocity = self._machine.command(self._motor)
            ramps = self._ramp(0x6083), self._ramp(0x6084)
            self._machine.plan(self._motor, profile_to_velocity(position, velocity, speed, *ramps))
        actual = self._machine.command(self._motor)[1]
        self.target_reached = abs(actual - speed) < _AT_REST
        self.mode_bit = abs(actual) < _AT_REST

    def _homing(self, rising: int, word: int, period_s: float) -> None:
        if rising & _SET_POINT:
            self._begin_homing(self._get(0x6098))
        elif self._search is not None and word & _SET_POINT:
            self._search_on(self._search)
        elif self._search is not None:
            self._search = None
            self._brake(self._ramp(0x609A))

    def _begin_homing(self, method: int) -> None:
        self.target_reached = self.mode_bit = self.error_bit = False
        if method in _HERE:
            self._attained()
            self.target_reached = True
        elif method in METHODS:
            fast, creep = (self._get(0x6099, sub) / self._scale.velocity for sub in (1, 2))
            self._search = Search(METHODS[method], fast, creep)
        else:
            self.error_bit = self.target_reached = True

    def _search_on(self, search: Search) -> None:
        """Run one period of a homing search; home is the edge of the switch."""
        before = search.phase
        search.step(self.inputs())
        if search.phase is Phase.FOUND and before is not Phase.FOUND:
            self._attained()
        position, velocity = self._machine.command(self._motor)
        speed = search.velocity * self._scale.polarity
        if speed != self._speed:
            self._speed, ramp = speed, self._ramp(0x609A)
            self._machine.plan(
                self._motor, profile_to_velocity(position, velocity, speed, ramp, ramp)
            )
        elif search.phase in (Phase.FOUND, Phase.FAILED) and self._rests():
            self._search, self._speed = None, None
            self.target_reached, self.error_bit = True, search.phase is Phase.FAILED

    def _attained(self) -> None:
        raw = self.counts(self._machine.position(self._motor)) + self._zero
        self._zero = raw - self._get(0x607C)
        self.mode_bit = True

    def _cyclic_position(self, rising: int, word: int, period_s: float) -> None:
        self._follow(self._unwrapped(self._get(0x607A)), word, period_s)

    def _interpolated_position(self, rising: int, word: int, period_s: float) -> None:
        if word & _SET_POINT:  # the bit enables interpolation here
            self._follow(self._unwrapped(self._get(0x60C1, 1)), word, period_s)
        self.mode_bit = bool(word & _SET_POINT)

    def _cyclic_velocity(self, rising: int, word: int, period_s: float) -> None:
        position, before = self._machine.command(self._motor)
        sign, unit = self._scale.polarity, self._scale.velocity
        speed = 0.0 if word & _HALT else self._get(0x60FF) / unit * sign
        change = (speed - before) / period_s
        end = position + 0.5 * (before + speed) * period_s
        self.mode_bit = True
        if speed or before:
            self._machine.plan(
                self._motor,
                [Segment(0.0, position, before, change), Segment(period_s, end, speed, 0.0)],
            )

    def _cyclic_torque(self, rising: int, word: int, period_s: float) -> None:
        rated_nm = self._get(0x6076) / 1000
        torque = 0.0 if word & _HALT else self._get(0x6071) / 1000 * rated_nm
        self.mode_bit = True
        self._machine.push(self._motor, torque * self._scale.polarity, period_s)

    def _follow(self, target: float, word: int, period_s: float) -> None:
        """A straight line to ``target`` in one period, within the limits of 0x607D.

        If the next setpoint is late, the line is extended by one period.
        """
        low, high = self._limits()
        self.limited = not low <= target <= high
        target = min(max(target, low), high)
        self.mode_bit = True
        position, velocity = self._machine.command(self._motor)
        if word & _HALT:
            if velocity:
                self._brake(self._ramp(0x6084))
            return
        if target == position and not self._machine.moves(self._motor):
            return
        speed = (target - position) / period_s
        line = Segment(0.0, position, speed, 0.0)
        end = min(max(target + speed * period_s, low), high)
        self._machine.plan(self._motor, [line, Segment(2 * period_s, end, 0.0, 0.0)])

    def _move(self, target: float) -> None:
        position, velocity = self._machine.command(self._motor)
        speed = min(self._get(0x6081), self._get(0x607F)) / self._scale.velocity
        profile = Profile(max(speed, 1e-6), self._ramp(0x6083), self._ramp(0x6084))
        low, high = self._limits()
        self.limited = not low <= target <= high
        target = min(max(target, low), high)
        plan = profile_to_position(position, velocity, target, profile, self._ramp(0x6085))
        self._machine.plan(self._motor, plan)

    def _brake(self, deceleration: float, then: Callable[[], None] | None = None) -> None:
        position, velocity = self._machine.command(self._motor)
        if abs(velocity) < 1e-12:
            self._machine.hold(self._motor, position)
            if then is not None:
                then()
            return
        self._machine.plan(self._motor, profile_to_rest(position, velocity, deceleration), then)

    def _rests(self) -> bool:
        return not self._machine.moves(self._motor)

    def _ramp(self, index: int) -> float:
        return max(1e-3, self._get(index) / self._scale.acceleration)

    def _limits(self) -> tuple[float, float]:
        """Soft limits 0x607D in rad; they count as absent at the ends of the encoder."""
        low, high = self._get(0x607D, 1), self._get(0x607D, 2)
        if low <= -(_SPAN // 2) or high >= _SPAN // 2 - 1:
            return -float("inf"), float("inf")
        ends = sorted(self._to_position(count) for count in (low, high))
        return ends[0], ends[1]

    def _to_position(self, counts: int) -> float:
        return (counts + self._zero) / self._scale.position * self._scale.polarity

    def _unwrapped(self, counts: int) -> float:
        """Unwrap a 32-bit target to the position nearest to the present command."""
        demand = self.counts(self._machine.command(self._motor)[0])
        short = (counts - demand + _SPAN // 2) % _SPAN - _SPAN // 2
        return self._to_position(demand + short)

    def _relative(self) -> float:
        return self._get(0x607A) / self._scale.position * self._scale.polarity
