"""CiA 402 servo drive for tests, written from CiA 301 and CiA 402-2, sharing no code with robotd.

As a process, driven by JSON lines on standard input (see harness.py):
``python -m tests.plugins.independent.cia402_node --channel 239.1.2.3 --node 5 --knob NAME=VALUE``
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from enum import IntEnum
from typing import Any

import can
from tests.plugins.independent.canopen_device import CanopenDevice, Nmt
from tests.plugins.independent.canopen_objects import (
    DEVICE_STATE,
    READ_ONLY,
    VALUE_RANGE,
    Abort,
    Entry,
    Pdo,
)
from tests.plugins.independent.knobs import Knobs
from tests.plugins.independent.servo_axis import HOMING_METHODS, MODES, Axis

CONNECTION_LOST = 0x8130


class State(IntEnum):
    """States of the power drive system, with their bits 0 to 3, 5 and 6 of the statusword."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(IntEnum):
    """Device control commands of the controlword, by its bits 0 to 3."""

    DISABLE_VOLTAGE = 0
    QUICK_STOP = 2
    SHUTDOWN = 6
    SWITCH_ON = 7  # also "disable operation"
    ENABLE = 15

    @classmethod
    def of(cls, controlword: int) -> Command:
        if not controlword & 2:
            return cls.DISABLE_VOLTAGE
        if not controlword & 4:
            return cls.QUICK_STOP
        if not controlword & 1:
            return cls.SHUTDOWN
        return cls.ENABLE if controlword & 8 else cls.SWITCH_ON


TRANSITIONS = {  # numbers as in the figure of CiA 402-2
    (State.SWITCH_ON_DISABLED, Command.SHUTDOWN): State.READY,  # 2
    (State.READY, Command.SWITCH_ON): State.SWITCHED_ON,  # 3
    (State.READY, Command.ENABLE): State.SWITCHED_ON,  # 3, then 4
    (State.READY, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,  # 7
    (State.READY, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 7
    (State.SWITCHED_ON, Command.ENABLE): State.ENABLED,  # 4
    (State.SWITCHED_ON, Command.SHUTDOWN): State.READY,  # 6
    (State.SWITCHED_ON, Command.QUICK_STOP): State.SWITCH_ON_DISABLED,  # 10
    (State.SWITCHED_ON, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 10
    (State.ENABLED, Command.SWITCH_ON): State.SWITCHED_ON,  # 5
    (State.ENABLED, Command.SHUTDOWN): State.READY,  # 8
    (State.ENABLED, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 9
    (State.ENABLED, Command.QUICK_STOP): State.QUICK_STOP,  # 11
    (State.QUICK_STOP, Command.DISABLE_VOLTAGE): State.SWITCH_ON_DISABLED,  # 12
    (State.QUICK_STOP, Command.ENABLE): State.ENABLED,  # 16
}
ENERGISED = {State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION}


class ServoDrive(CanopenDevice):
    """CiA 402 drive with one axis that follows its set-points with a lag and a highest speed."""

    triggers = frozenset({0x6040})

    def __init__(
        self, node_id: int, send: Callable[[can.Message], None], knobs: Knobs | None = None
    ) -> None:
        self.knobs, self.to_bus = knobs or Knobs(), send
        super().__init__(node_id, lambda frame: None if self.knobs.mute else send(frame))
        self.power = State.NOT_READY
        self.axis = Axis(self)
        self.after_braking = State.NOT_READY
        self._closing: tuple[float, State] | None = None  # brake: when it holds, and what follows
        self.history: deque[tuple[float, int]] = deque([(0.0, 0)])  # of the statusword
        self.emergencies: list[int] = []
        self._asked_mode = 0, 0.0  # as 0x6060 was set last, and when
        self._add_drive_objects()
        self._map_pdos()
        self._apply_knobs()
        self.restart()

    def _add_drive_objects(self) -> None:
        i, h, turn = "i", "h", self.knobs.encoder
        p = h if self.knobs.position_bits == 16 else i
        variables: list[tuple[int, str, str, int, str, str]] = [
            (0x6007, "Abort connection option code", h, 1, "rw", ""),
            (0x603F, "Error code", "H", 0, "ro", "t"),
            (0x6040, "Controlword", "H", 0, "rw", "r"),
            (0x6041, "Statusword", "H", 0, "ro", "t"),
            (0x605A, "Quick stop option code", h, 2, "rw", ""),
            (0x605B, "Shutdown option code", h, 0, "rw", ""),
            (0x605C, "Disable operation option code", h, 1, "rw", ""),
            (0x605D, "Halt option code", h, 1, "rw", ""),
            (0x605E, "Fault reaction option code", h, 2, "rw", ""),
            (0x6060, "Modes of operation", "b", 0, "rw", "r"),
            (0x6061, "Modes of operation display", "b", 0, "ro", "t"),
            (0x6062, "Position demand value", p, 0, "ro", "t"),
            (0x6064, "Position actual value", p, 0, "ro", "t"),
            (0x6065, "Following error window", "I", 0xFFFF_FFFF, "rw", ""),
            (0x6066, "Following error time out", "H", 0, "rw", ""),
            (0x6067, "Position window", "I", 20, "rw", ""),
            (0x6068, "Position window time", "H", 5, "rw", ""),
            (0x606C, "Velocity actual value", i, 0, "ro", "t"),
            (0x6071, "Target torque", h, 0, "rw", "r"),
            (0x6072, "Max torque", "H", 3000, "rw", "r"),
            (0x6076, "Motor rated torque", "I", round(self.knobs.rated_torque_nm * 1e3), "ro", ""),
            (0x6077, "Torque actual value", h, 0, "ro", "t"),
            (0x607A, "Target position", p, 0, "rw", "r"),
            (0x607C, "Home offset", i, 0, "rw", ""),
            (0x6081, "Profile velocity", "I", turn, "rw", "r"),
            (0x6083, "Profile acceleration", "I", 10 * turn, "rw", "r"),
            (0x6084, "Profile deceleration", "I", 10 * turn, "rw", "r"),
            (0x6085, "Quick stop deceleration", "I", 40 * turn, "rw", ""),
            (0x6098, "Homing method", "b", 35, "rw", ""),
            (0x609A, "Homing acceleration", "I", 10 * turn, "rw", ""),
            (0x60F4, "Following error actual value", i, 0, "ro", "t"),
            (0x60FF, "Target velocity", i, 0, "rw", "r"),
            (0x6502, "Supported drive modes", "I", self.knobs.supported_modes, "ro", ""),
        ]
        for index, name, kind, value, access, pdo in variables:
            self.add(index, name, Entry(name, kind, value, access, pdo))
        low, high = Entry("Min", i, -(2**31)), Entry("Max", i, 2**31 - 1)
        self.add(0x607D, "Software position limit", low, high)
        switch, zero = Entry("For switch", "I", turn // 2), Entry("For zero", "I", turn // 4)
        self.add(0x6099, "Homing speeds", switch, zero)
        period = Entry("Period", "B", 2), Entry("Index", "b", -3)
        self.add(0x60C2, "Interpolation time period", *period)
        for index, name, numerator in (
            (0x608F, "Position encoder resolution", self.knobs.encoder),
            (0x6091, "Gear ratio", 1),
            (0x6092, "Feed constant", self.knobs.feed),
        ):
            self.add(index, name, Entry("Numerator", "I", numerator), Entry("Denominator", "I", 1))
        self.objects[0x1000, 0].default = 0x0002_0192  # servo drive
        self.hooks.update(
            {
                0x6040: self._controlword,
                0x6060: self._mode,
                0x607A: self._target,
                0x6098: self._homing_method,
            }
        )

    def _map_pdos(self) -> None:
        knobs = self.knobs
        word, mode, target, speed = (0x6040, 0), (0x6060, 0), (0x607A, 0), (0x60FF, 0)
        outputs = (word,), (word, mode), (word, target), (word, speed)
        for pdo, keys in zip(self.rpdos, outputs, strict=True):
            pdo.map_default(*self._mappable(keys), valid=keys == (word,))
        status, position, velocity = (0x6041, 0), (0x6064, 0), (0x606C, 0)
        own = (position,) if knobs.position_alone else (status, position)
        inputs = (status,), (status, (0x6061, 0)), own, (status, velocity)
        for pdo, keys in zip(self.tpdos, inputs, strict=True):
            special = position in keys and (knobs.position_alone or knobs.event_position)
            valid = keys == (status,) or special or knobs.self_starting
            pdo.map_default(*self._mappable(keys), valid=valid)

    def _mappable(self, keys: tuple[tuple[int, int], ...]) -> list[tuple[int, int]]:
        return [key for key in keys if key[0] not in self.knobs.unmapped]

    def _apply_knobs(self) -> None:
        knobs = self.knobs
        if knobs.event_position:
            self.remove(self.tpdos[2].communication, 5)
        for index in knobs.absent:
            self.remove(index)
            self.names.pop(index, None)
        for (index, _), entry in self.objects.items():
            if index in knobs.rejected and knobs.rejection == "ro" and entry.access == "rw":
                entry.access = "ro"
            if knobs.fixed_mapping and 0x1400 <= index < 0x1C00 and index & 0x200:
                entry.access = "const"
            if index in knobs.unmapped:
                entry.pdo = ""
            if knobs.empty_strings and entry.kind == "s":
                entry.default = ""
        if 0x1017 not in knobs.absent:
            self.objects[0x1017, 0].default = knobs.heartbeat_ms

    # Knobs that act on the communication

    def announces(self, pdo: Pdo) -> bool:
        return not (self.knobs.event_position and pdo is self.tpdos[2])

    def transmit_pdo(self, can_id: int, data: bytes) -> None:
        self.transmit(can_id, data[: len(data) - self.knobs.missing_bytes])

    def answer_delay_s(self, index: int, sub: int, write: bool) -> float | None:
        if index in self.knobs.sdo_mute or self.knobs.sdo_missing:
            self.knobs.sdo_missing -= self.knobs.sdo_missing > 0
            return None
        return self.knobs.store_s if index == 0x1010 and write else self.knobs.sdo_delay_s

    def write(self, index: int, sub: int, data: bytes) -> None:
        if index in self.knobs.rejected:
            self.writes[f"{index:04X}:{sub}"] += 1
            raise Abort(READ_ONLY if self.knobs.rejection == "ro" else DEVICE_STATE)
        super().write(index, sub, data)

    # Rules of single objects

    def _mode(self, sub: int, value: int) -> None:
        if value not in MODES:
            raise Abort(VALUE_RANGE)

    def _homing_method(self, sub: int, value: int) -> None:
        if value not in HOMING_METHODS:
            raise Abort(VALUE_RANGE)

    def _target(self, sub: int, value: int) -> None:
        if self.power is State.ENABLED:
            self.axis.set_target(value)

    def _controlword(self, sub: int, value: int) -> None:
        rising = value & ~self[0x6040]
        self[0x6040] = value
        if self.power is State.FAULT and rising & 0x80:
            self[0x603F] = 0
            self._go(State.SWITCH_ON_DISABLED)  # 15
            self.emergency(0, 0)
        elif self.power is State.ENABLED and rising & 0x10:
            self.axis.start(value)
        self._obey()

    # State machine

    def _obey(self) -> None:
        """Follow the controlword: one or more transitions of the power drive system."""
        controlword = self[0x6040]
        if controlword & 0x82 == 0 and self.power is not State.FAULT_REACTION:
            self.axis.braking = None  # "disable voltage" does not wait for standstill
        while not controlword & 0x80 and self.axis.braking is None:
            command = Command.of(controlword)
            if self._closing and command is not Command.DISABLE_VOLTAGE:
                return
            target = TRANSITIONS.get((self.power, command))
            stays = self.power is State.QUICK_STOP and self.get(0x605A, 0, 2) < 5
            if target is None or (stays and command is Command.ENABLE):
                return
            ramped = {State.SWITCHED_ON: 0x605C, State.READY: 0x605B}.get(target)
            if self.power is State.ENABLED and ramped and self[ramped] == 1:
                self._brake(1, target)
            elif target is State.QUICK_STOP:
                self._quick_stop()
            elif command is Command.DISABLE_VOLTAGE and self.power in ENERGISED:
                self._go(target)
                self.axis.drop()
            elif self.power in ENERGISED and target not in ENERGISED and self.knobs.brake_close_s:
                self._closing = self.now + self.knobs.brake_close_s, target
            else:
                self._go(target)

    def _brake(self, option: int, after: State) -> None:
        self.axis.braking, self.after_braking = self.axis.deceleration(option), after

    def _quick_stop(self) -> None:
        option = self.get(0x605A, 0, 2)
        if option == 0:
            self._go(State.SWITCH_ON_DISABLED)
            return
        self._go(State.QUICK_STOP)
        after = State.QUICK_STOP if option >= 5 else State.SWITCH_ON_DISABLED
        self._brake(1 if option in {1, 5} else 2, after)

    def _go(self, state: State) -> None:
        self.axis.braking, self.power, self._closing = None, state, None
        if state is State.ENABLED:
            self.counts["enabled"] += 1
            self.counts["enabled_blind"] += 0x6064 not in self.reported
            self.axis.enable()
            self.axis.begin_mode()

    def fault(self, code: int, register: int = 0x20) -> None:
        """React to a fault: EMCY, fault reaction, state Fault."""
        if self.power in {State.FAULT, State.FAULT_REACTION}:
            return
        option = self[0x605E]
        if self.power in ENERGISED and option:
            self._go(State.FAULT_REACTION)
            self._brake(option, State.FAULT)
        else:
            self._go(State.FAULT)
        self[0x603F] = code if self.knobs.code_in_603f else 0
        self.emergency(code, register)

    def emergency(self, code: int, register: int) -> None:
        self.emergencies.append(code)
        super().emergency(code, register)

    def _abort_connection(self) -> None:
        option = self.get(0x6007, 0, 1)
        if self.power is not State.ENABLED:
            return
        if option == 1:
            self.fault(CONNECTION_LOST, 0x10)
        elif option == 2:
            self._go(State.SWITCH_ON_DISABLED)
        elif option == 3:
            self._quick_stop()

    def heartbeat_lost(self) -> None:
        super().heartbeat_lost()
        self._abort_connection()

    def enter(self, state: Nmt) -> None:
        if state is Nmt.STOPPED:
            self._abort_connection()
        super().enter(state)

    def restart(self, communication_only: bool = False) -> None:
        self.boot_s, self.self_starting = self.knobs.boot_s, self.knobs.self_starting
        super().restart(communication_only)
        if communication_only:
            self._abort_connection()
        else:
            self._go(State.NOT_READY)
            self.history = deque([(self.now, 0)])
        self._publish()

    # Time

    def tick(self, now: float) -> None:
        self.heartbeat_copies = self.knobs.heartbeat_copies
        if self.power is State.NOT_READY and self.state is not Nmt.INITIALISING:
            self._go(State.SWITCH_ON_DISABLED)  # 0 and 1
        self._advance(now)
        super().tick(now)

    def receive(self, message: can.Message, now: float) -> None:
        self._advance(now)
        super().receive(message, now)

    def _advance(self, now: float) -> None:
        elapsed, self.now = now - self.now, now
        steps = math.ceil(elapsed / self.knobs.step_s)
        for _ in range(steps):
            halted = self.power is State.QUICK_STOP or self._halted or self._closing is not None
            self.axis.move(elapsed / steps, self.power in ENERGISED, halted)
            if self.axis.braking and not self.axis.velocity:
                self._go(self.after_braking)
        if self._closing and now >= self._closing[0]:
            self._go(self._closing[1])
        self._obey()
        if self._asked_mode[0] != self[0x6060]:
            self._asked_mode = self[0x6060], now
        mode, asked_s = self._asked_mode
        if self[0x6061] != mode and now - asked_s >= self.knobs.mode_delay_s:
            self[0x6061] = mode
            if self.power is State.ENABLED:
                self.axis.begin_mode()
        self._publish()

    @property
    def _halted(self) -> bool:
        return self.power is State.ENABLED and bool(self[0x6040] & 0x100)

    def _publish(self) -> None:
        self.axis.publish()
        word = self.power | 0x0210 | 0x800 * (abs(self.axis.velocity) >= self.knobs.max_speed)
        if self.power is State.ENABLED:
            word |= self.axis.status_bits(self._halted)
        if word != self.history[-1][1]:
            self.history.append((self.now, word))
        while len(self.history) > 1 and self.history[1][0] + self.knobs.status_delay_s <= self.now:
            self.history.popleft()
        self[0x6041] = self.history[0][1]

    # For tests

    def drop_to_pre_operational(self) -> None:
        self.enter(Nmt.PRE_OPERATIONAL)

    def stop(self) -> None:
        self.enter(Nmt.STOPPED)

    def clear(self) -> None:
        """Forget what was measured so far."""
        self.axis.max_velocity = self.axis.max_step = 0.0
        self.emergencies.clear()
        self.counts.clear()
        self.writes.clear()

    def measurements(self) -> dict[str, Any]:
        """Return what a test wants to know; positions and speeds are in counts."""
        return {
            "nmt": self.state.name,
            "power": self.power.name,
            "statusword": self[0x6041],
            "mode": self[0x6061],
            "position": self.axis.position,
            "velocity": self.axis.velocity,
            "energised": self.power in ENERGISED,
            "max_velocity": self.axis.max_velocity,
            "max_step": self.axis.max_step,
            "emergencies": self.emergencies,
            "counts": dict(self.counts),
            "writes": dict(self.writes),
            "reported": sorted(self.reported),
        }


if __name__ == "__main__":
    from tests.plugins.independent.harness import main

    main()
