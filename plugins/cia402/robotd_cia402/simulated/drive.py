"""A simulated CiA 402 axis: state machine, statusword, supervision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from enum import Enum, auto

from robotd_cia402.simulated.drive_dictionary import AXIS_STEP, Objects
from robotd_cia402.simulated.mode_motion import Mode, Motion
from robotd_cia402.simulated.motors import Motors
from robotd_cia402.simulated.scale import NO_SWITCHES, Scale, Switches

_REMOTE, _TARGET_REACHED, _LIMIT, _MODE_BIT, _ERROR_BIT = 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13
_FOLLOWING_ERROR, _REFERENCE_LIMIT = 0x8611, 0x8612
_NO_WINDOW = 0xFFFFFFFF
_STAYS = (5, 6, 7, 8)  # option codes of a quick stop after which the drive stays in that state
_BRAKES = (2, 3)  # option codes of 0x6007 that stop without a fault
_INT32 = 1 << 31
Place = tuple[int, int | None]  # index and subindex of an object; None: all subindices
_FAULT_RESET = 0x80
_TRANSITION_BITS = 0x0F


class SimulatedState(Enum):
    """State of a drive; the value is its statusword pattern (CiA 402-2, table 30)."""

    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x31
    SWITCHED_ON = 0x33
    OPERATION_ENABLED = 0x37
    QUICK_STOP_ACTIVE = 0x17
    FAULT_REACTION_ACTIVE = 0x1F
    FAULT = 0x08


class Command(Enum):
    """Command in a controlword (CiA 402-2, table 27)."""

    DISABLE_VOLTAGE = auto()
    QUICK_STOP = auto()
    SHUTDOWN = auto()
    SWITCH_ON = auto()
    ENABLE_OPERATION = auto()


TRANSITIONS: dict[tuple[SimulatedState, Command], SimulatedState] = {
    (SimulatedState.SWITCH_ON_DISABLED, Command.SHUTDOWN): SimulatedState.READY_TO_SWITCH_ON,
    (SimulatedState.READY_TO_SWITCH_ON, Command.SWITCH_ON): SimulatedState.SWITCHED_ON,
    (SimulatedState.READY_TO_SWITCH_ON, Command.ENABLE_OPERATION): SimulatedState.OPERATION_ENABLED,
    (SimulatedState.READY_TO_SWITCH_ON, Command.QUICK_STOP): SimulatedState.SWITCH_ON_DISABLED,
    (SimulatedState.READY_TO_SWITCH_ON, Command.DISABLE_VOLTAGE): SimulatedState.SWITCH_ON_DISABLED,
    (SimulatedState.SWITCHED_ON, Command.ENABLE_OPERATION): SimulatedState.OPERATION_ENABLED,
    (SimulatedState.SWITCHED_ON, Command.SHUTDOWN): SimulatedState.READY_TO_SWITCH_ON,
    (SimulatedState.SWITCHED_ON, Command.QUICK_STOP): SimulatedState.SWITCH_ON_DISABLED,
    (SimulatedState.SWITCHED_ON, Command.DISABLE_VOLTAGE): SimulatedState.SWITCH_ON_DISABLED,
    (SimulatedState.OPERATION_ENABLED, Command.SWITCH_ON): SimulatedState.SWITCHED_ON,
    (SimulatedState.OPERATION_ENABLED, Command.SHUTDOWN): SimulatedState.READY_TO_SWITCH_ON,
    (SimulatedState.OPERATION_ENABLED, Command.DISABLE_VOLTAGE): SimulatedState.SWITCH_ON_DISABLED,
    (SimulatedState.OPERATION_ENABLED, Command.QUICK_STOP): SimulatedState.QUICK_STOP_ACTIVE,
    (SimulatedState.QUICK_STOP_ACTIVE, Command.ENABLE_OPERATION): SimulatedState.OPERATION_ENABLED,
    (SimulatedState.QUICK_STOP_ACTIVE, Command.DISABLE_VOLTAGE): SimulatedState.SWITCH_ON_DISABLED,
}


def command(controlword: int) -> Command:
    """Return the command in bits 0 to 3."""
    bits = controlword & _TRANSITION_BITS
    if not bits & 2:
        return Command.DISABLE_VOLTAGE
    if not bits & 4:
        return Command.QUICK_STOP
    if not bits & 1:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if bits & 8 else Command.SWITCH_ON


def resets_fault(before: int, now: int) -> bool:
    """Return True if bit 7 rises from one controlword to the next."""
    return bool(now & ~before & _FAULT_RESET)


@dataclass
class DriveFaults:
    """Faults in force for one drive; the defaults are a healthy one.

    Attributes:
        statusword: shown instead of the real one.
        mode: likewise, object 0x6061.
        blocked: the motor does not move.
        aborts: object → abort code of every access.
        unanswered: objects of which SDO requests get no response.
    """

    statusword: int | None = None
    mode: int | None = None
    blocked: bool = False
    aborts: dict[Place, int] = field(default_factory=dict)
    unanswered: set[Place] = field(default_factory=set)

    def heal(self) -> None:
        """End all faults."""
        healthy = type(self)()
        for fault in fields(self):
            setattr(self, fault.name, getattr(healthy, fault.name))

    def abort_code(self, index: int, sub: int) -> int | None:
        """Return the abort code of an access; None: it is not aborted."""
        return self.aborts.get((index, sub), self.aborts.get((index, None)))

    def ignores(self, index: int, sub: int) -> bool:
        """Return True if a request for the object gets no response."""
        return (index, sub) in self.unanswered or (index, None) in self.unanswered


@dataclass(frozen=True)
class DriveModel:
    """One axis as it is built.

    Attributes:
        motor: its number in the machine.
        axis_offset: its place in a multi-axis drive, 0 for the first.
        scale: counts, velocity and acceleration units per rad (or m).
        rated_torque_nm: 100 % of object 0x6077.
        switches: limit and home switches.
    """

    motor: int
    scale: Scale
    axis_offset: int = 0
    rated_torque_nm: float = 100.0
    switches: Switches = NO_SWITCHES


class Drive:
    """One axis, advanced once for each cyclic frame: ``sample``, outputs stored, ``sync``.

    Used by the thread of the simulation alone.

    Args:
        values: objects of the drive, shared with its bus model; it holds ``drive_defaults``.
        faults: injected from outside.
        emergency: sends an emergency, given error code and error register; 0: error reset.
    """

    def __init__(
        self,
        model: DriveModel,
        values: Objects,
        machine: Motors,
        faults: DriveFaults,
        emergency: Callable[[int, int], None],
    ) -> None:
        self.state = SimulatedState.SWITCH_ON_DISABLED
        self._model, self._values, self._machine, self._faults = model, values, machine, faults
        self._emergency = emergency
        self._offset = model.axis_offset * AXIS_STEP
        self.motion = Motion(model.motor, model.scale, machine, self.get, model.switches)
        self.closed_switches = 0  # bits of object 0x60FD, wherever the motor is
        self._controlword = 0
        self._blocked_at = 0.0
        self._following_error_s = 0.0

    @property
    def axis_offset(self) -> int:
        """Place of the axis in a multi-axis drive."""
        return self._model.axis_offset

    @property
    def position(self) -> float:
        """True position of the motor, rad or m from its position at power-on."""
        return self._machine.position(self._model.motor) - self.motion.zero

    @property
    def torque(self) -> float:
        """Torque of the motor, N·m."""
        return self._machine.torque(self._model.motor)

    def press(self, bit: int, *, pressed: bool) -> None:
        """Close a switch (bit of object 0x60FD), or release it."""
        others = self.closed_switches & ~(1 << bit)
        self.closed_switches = others | int(pressed) << bit

    def push(self, delta: float) -> None:
        """Turn the motor by hand; no effect on an enabled drive, unless it has a torque alone."""
        enabled = SimulatedState.OPERATION_ENABLED, SimulatedState.QUICK_STOP_ACTIVE
        yields = self.state is enabled[0] and self.motion.mode is Mode.CYCLIC_TORQUE
        if self.state not in enabled or yields:
            position = self._machine.position(self._model.motor) + delta
            self._machine.servo.place(self._model.motor, position, position, 0.0)
            self._machine.hold(self._model.motor, position)

    def get(self, index: int, sub: int = 0) -> int:
        """A profile object of this axis."""
        return self._values[index + self._offset, sub]

    def put(self, index: int, value: int) -> None:
        self._values[index + self._offset, 0] = value

    def power_on(self) -> None:
        """Enter the state after a reset: no power, no fault, position kept."""
        self._leave_power(SimulatedState.SWITCH_ON_DISABLED)
        self._controlword = 0
        self.put(0x6076, round(self._model.rated_torque_nm * 1000))
        self.sample(0.0)

    def sync(self, period_s: float) -> None:
        """Act on the objects for one period of ``period_s``."""
        before, word = self._controlword, self.get(0x6040)
        self._controlword = word
        self._act(before, word, period_s)
        shown = self._faults.mode
        self.put(0x6061, int(self.motion.mode) if shown is None else shown)
        self.put(0x6041, self._statusword())

    def sample(self, period_s: float) -> None:
        """Supervise, and update the measured objects."""
        if self._faults.blocked:
            self._machine.keep(self._model.motor, self._blocked_at)
        else:
            self._blocked_at = self._machine.position(self._model.motor)
        self._measure()
        if self.state in (SimulatedState.OPERATION_ENABLED, SimulatedState.QUICK_STOP_ACTIVE):
            self._supervise(period_s)
        self.put(0x6041, self._statusword())

    def trip(self, code: int) -> None:
        """A fault: brake with the quick stop's ramp, then power off."""
        if self.state in (SimulatedState.FAULT, SimulatedState.FAULT_REACTION_ACTIVE):
            return
        self.put(0x603F, code)
        powered = self.state in (SimulatedState.OPERATION_ENABLED, SimulatedState.QUICK_STOP_ACTIVE)
        self.state = SimulatedState.FAULT_REACTION_ACTIVE
        self._emergency(code, 1 if code < 0x8000 else 0x21)
        if powered and not self._faults.blocked:
            self.motion.quick_stop(lambda: self._leave_power(SimulatedState.FAULT))
        else:
            self._leave_power(SimulatedState.FAULT)

    def connection_lost(self) -> None:
        """React to the missing heartbeat of the master as object 0x6007 defines."""
        option = self.get(0x6007)
        if option == 1:
            self.trip(0x8130)
        elif option in _BRAKES and self.state is SimulatedState.OPERATION_ENABLED:
            self._enter(SimulatedState.QUICK_STOP_ACTIVE)

    def _act(self, before: int, word: int, period_s: float) -> None:
        if self.state is SimulatedState.FAULT:
            if resets_fault(before, word):
                self.state = SimulatedState.SWITCH_ON_DISABLED
                self.put(0x603F, 0)
                self._emergency(0, 0)
            return
        if self.state is SimulatedState.FAULT_REACTION_ACTIVE:
            return
        target = TRANSITIONS.get((self.state, command(word)))
        if target is not None:
            self._enter(target)
        if self.state is SimulatedState.OPERATION_ENABLED:
            self.motion.act(Mode.of(self.get(0x6060)), before, word, period_s)
        elif self.state is SimulatedState.QUICK_STOP_ACTIVE:
            self.motion.prepare(Mode.of(self.get(0x6060)))

    def _enter(self, state: SimulatedState) -> None:
        if state is self.state:
            return
        before, self.state = self.state, state
        if (
            state is SimulatedState.OPERATION_ENABLED
            and before is not SimulatedState.QUICK_STOP_ACTIVE
        ):
            self._machine.enable(self._model.motor)
            self.motion.begin()
        elif state is SimulatedState.OPERATION_ENABLED:
            self.motion.begin()
        elif state is SimulatedState.QUICK_STOP_ACTIVE:
            stays = self.get(0x605A) in _STAYS
            self.motion.quick_stop(
                None if stays else lambda: self._leave_power(SimulatedState.SWITCH_ON_DISABLED)
            )
        elif before in (SimulatedState.OPERATION_ENABLED, SimulatedState.QUICK_STOP_ACTIVE):
            self._leave_power(state)

    def _leave_power(self, state: SimulatedState) -> None:
        self.state = state
        self._machine.disable(self._model.motor)

    def _measure(self) -> None:
        machine, motor, scale = self._machine, self._model.motor, self._model.scale
        position = self.motion.counts(machine.position(motor))
        demand = self.motion.counts(machine.command(motor)[0])
        self.put(0x6064, _wrap(position))
        self.put(0x6062, _wrap(demand))
        self.put(0x60F4, _wrap(demand - position))
        self.put(0x606C, round(machine.velocity(motor) * scale.velocity * scale.polarity))
        torque = 1000 * machine.torque(motor) / self._model.rated_torque_nm
        self.put(0x6077, max(-32768, min(32767, round(torque * scale.polarity))))
        self.put(0x60FD, self.motion.inputs() | self.closed_switches)

    def _supervise(self, period_s: float) -> None:
        window, error = self.get(0x6065), abs(self.get(0x60F4))
        late = window != _NO_WINDOW and error > window
        self._following_error_s = self._following_error_s + period_s if late else 0.0
        if late and self._following_error_s * 1000 > self.get(0x6066):
            self.trip(_FOLLOWING_ERROR)
        speed = self._machine.command(self._model.motor)[1] * self._model.scale.polarity
        inputs = self.get(0x60FD)
        outwards = (inputs & 1 and speed < 0) or (inputs & 2 and speed > 0)
        if outwards and self.motion.mode is not Mode.HOMING:
            self.trip(_REFERENCE_LIMIT)

    def _statusword(self) -> int:
        if self._faults.statusword is not None:
            return self._faults.statusword
        word = self.state.value | _REMOTE
        motion = self.motion
        if self.state in (SimulatedState.OPERATION_ENABLED, SimulatedState.QUICK_STOP_ACTIVE):
            word |= _TARGET_REACHED if motion.target_reached else 0
            word |= _MODE_BIT if motion.mode_bit else 0
            word |= _ERROR_BIT if motion.error_bit else 0
            word |= _LIMIT if motion.limited else 0
        return word


def _wrap(counts: int) -> int:
    """Wrap counts as a 32-bit encoder does."""
    return (counts + _INT32) % (2 * _INT32) - _INT32
