"""Object dictionaries (SDO) of the simulated slaves: identity, and the drives' CiA 402 objects.

Values that a drive measures are those of the simulation. Parameters are kept as they are written
and have no effect on its motion; commands cannot be written.
"""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from robotd.api import CommandMode, OperationError
from robotd_cia402.simulated.drive_dictionary import DRIVE_OBJECTS, DriveObject
from robotd_sim.network import Slave
from robotd_sim.scaling import wrap32
from robotd_sim.simulation import Simulation

DRIVE_TYPE, MODULE_TYPE = 0x0002_0192, 0x0003_0191  # servo drive, digital I/O
COMMANDS = frozenset({0x6040, 0x6060, 0x6071, 0x607A, 0x60B1, 0x60B2, 0x60C1, 0x60FF})
CYCLIC_MODES = {CommandMode.POSITION: 8, CommandMode.VELOCITY: 9, CommandMode.TORQUE: 10}
FAULT, ENABLED, DISABLED = 0x0208, 0x0237, 0x0250  # statuswords: remote, with its voltage
ABORTS = {
    0x0601_0002: "the object is read-only",
    0x0602_0000: "the object does not exist",
    0x0607_0010: "wrong length",
    0x0609_0011: "the subindex does not exist",
    0x0800_0022: "the master commands it in each cycle",
}

_PROFILE = {(entry.index, entry.sub): entry for entry in DRIVE_OBJECTS}
Key = tuple[int, int]


class SlaveObjects:
    """Objects of all slaves. Hold the world's lock."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._written: dict[tuple[int, Key], bytes] = {}

    def read(self, slave: Slave, index: int, sub: int) -> bytes:
        """Return the value, little-endian. Raises OperationError with the abort code."""
        found = self._find(slave, (index, sub))
        if found is None:
            self._abort(slave, "reading", (index, sub), self._missing(slave, index))
        return found

    def write(self, slave: Slave, index: int, sub: int, data: bytes) -> None:
        """Keep the value of a parameter. Raises OperationError with the abort code."""
        key = (index, sub)
        before = self._find(slave, key)
        known = _PROFILE.get(key) if slave.axis is not None else None
        code = 0
        if before is None:
            code = self._missing(slave, index)
        elif known is None or not known.writable:
            code = 0x0601_0002
        elif index in COMMANDS:
            code = 0x0800_0022
        elif len(data) != len(before):
            code = 0x0607_0010
        if code:
            self._abort(slave, "writing", key, code)
        self._written[slave.id, key] = data

    def _find(self, slave: Slave, key: Key) -> bytes | None:
        if (text := self._identity(slave, key)) is not None:
            return text
        known = _PROFILE.get(key)
        if slave.axis is None or known is None:
            return None
        if (written := self._written.get((slave.id, key))) is not None:
            return written
        value = self._measured(slave.axis).get(key, known.default)
        return _octets(known, value)

    def _identity(self, slave: Slave, key: Key) -> bytes | None:
        """Return an object that every slave has."""
        node = slave.node(0, communicating=self._simulation.communicating)
        numbers = (node.vendor_id, node.product_code, node.revision, node.serial)
        match key:
            case (0x1000, 0):
                return (MODULE_TYPE if slave.axis is None else DRIVE_TYPE).to_bytes(4, "little")
            case (0x1008, 0):
                return b"simulated module" if slave.axis is None else b"simulated drive"
            case (0x1018, 0):
                return bytes([len(numbers)])
            case (0x1018, 1 | 2 | 3 | 4):
                return numbers[key[1] - 1].to_bytes(4, "little")
        return None

    def _measured(self, axis: int) -> dict[Key, int]:
        """Return the values of a drive that are not its parameters."""
        simulation = self._simulation
        states, servo, scaling = simulation.states, simulation.servo, simulation.scaling
        gain = float(scaling.gain[axis])
        place, demand = (
            wrap32(scaling.counts(value))[axis] for value in (servo.position, servo.command)
        )
        status = FAULT if states.amp_alarm[axis] else ENABLED if states.servo_on[axis] else DISABLED
        return {
            (0x603F, 0): int(states.alarm_code[axis]),
            (0x6041, 0): status,
            (0x6060, 0): CYCLIC_MODES[CommandMode(states.mode[axis])],
            (0x6061, 0): CYCLIC_MODES[CommandMode(states.mode_feedback[axis])],
            (0x6062, 0): int(demand),
            (0x6064, 0): int(place),
            (0x606C, 0): round(servo.velocity(axis) * gain),
            (0x607A, 0): int(demand),
            (0x60F4, 0): round(float(servo.command[axis] - servo.position[axis]) * gain),
        }

    def _missing(self, slave: Slave, index: int) -> int:
        indices = {0x1018} if slave.axis is None else {0x1018, *(key[0] for key in _PROFILE)}
        return 0x0609_0011 if index in indices else 0x0602_0000

    @staticmethod
    def _abort(slave: Slave, what: str, key: Key, code: int) -> NoReturn:
        raise OperationError(
            f"slave {slave.id}: {what} 0x{key[0]:04X}:{key[1]:02X}: {ABORTS[code]}"
            f" (SDO abort 0x{code:08X})"
        )


def _octets(known: DriveObject, value: int) -> bytes:
    bits, signed = known.kind
    lowest, highest = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    return int(np.clip(value, lowest, highest)).to_bytes(bits // 8, "little", signed=signed)
