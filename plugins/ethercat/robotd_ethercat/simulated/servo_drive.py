"""CiA 402 servo drive with one axis or several."""

from __future__ import annotations

from collections.abc import Sequence

from robotd_cia402.simulated import DRIVE_OBJECTS, Drive, DriveModel, DriveObject, Motors
from robotd_ethercat.simulated.al_state import AlState
from robotd_ethercat.simulated.object_dictionary import (
    READ_ONLY,
    READ_WRITE,
    Access,
    DataType,
    Entry,
    ObjectCode,
    ObjectDefinition,
    variable,
)
from robotd_ethercat.simulated.sii_content import Identity
from robotd_ethercat.simulated.simulated_slave import Command, Slave
from robotd_ethercat.simulated.standard_objects import Mapping, assignment, pdo

_AXIS_STEP, _PDO_STEP = 0x800, 0x10  # from one axis of a drive to the next
_SERVO_DRIVE = 0x0002_0192  # device type: profile 402, servo drive
_OVER_VOLTAGE = 0x3210
_POWERED = ("OPERATION_ENABLED", "QUICK_STOP_ACTIVE")
_KINDS = {
    (8, False): DataType.UNSIGNED8,
    (16, False): DataType.UNSIGNED16,
    (32, False): DataType.UNSIGNED32,
    (8, True): DataType.INTEGER8,
    (16, True): DataType.INTEGER16,
    (32, True): DataType.INTEGER32,
}
_RX: dict[int, tuple[str, Mapping]] = {
    0x1600: ("All modes", [(0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32), (0x60FF, 0, 32)]),
    0x1601: ("Position", [(0x6040, 0, 16), (0x6060, 0, 8), (0x607A, 0, 32)]),
    0x1603: ("Target torque", [(0x6071, 0, 16)]),
    0x1602: ("Velocity", [(0x6040, 0, 16), (0x6060, 0, 8), (0x60FF, 0, 32)]),
}
_TX: dict[int, tuple[str, Mapping]] = {
    0x1A00: (
        "All values",
        [
            (0x6041, 0, 16),
            (0x6061, 0, 8),
            (0x6064, 0, 32),
            (0x606C, 0, 32),
            (0x6077, 0, 16),
            (0x603F, 0, 16),
            (0x60FD, 0, 32),
        ],
    ),
    0x1A01: ("Position", [(0x6041, 0, 16), (0x6061, 0, 8), (0x6064, 0, 32)]),
}


class ServoDrive(Slave):
    """Drive whose axes turn motors of ``machine``.

    The PDOs 0x1600 and 0x1A00 are assigned at power-on; others exist, and all can be changed in
    PreOp. Axis n has its objects n × 0x800 and its PDOs n × 0x10 further.
    """

    def __init__(
        self,
        identity: Identity,
        machine: Motors,
        models: Sequence[DriveModel],
        now_ns: int,
        *,
        alias: int = 0,
    ) -> None:
        self.drives: list[Drive] = []
        offsets = sorted(model.axis_offset for model in models)
        super().__init__(identity, "Servo drive", _objects(offsets), now_ns, alias=alias)
        self.drives = [
            Drive(model, self.objects.values, machine, self.faults, self.emergency)
            for model in models
        ]
        self._reset_axes()

    @property
    def commands(self) -> dict[str, Command]:
        return {
            "trip": self._trip,
            "position": lambda words: repr(self._axis(words).position),
            "torque": lambda words: repr(self._axis(words).torque),
            "push": lambda words: self._axis(words[1:]).push(float(words[0])),
            "press": self._press,
            "statusword": self._statusword,
            "mode": self._mode,
            "block": self._block,
        }

    def power_on(self, now_ns: int) -> None:
        super().power_on(now_ns)
        self._reset_axes()

    def power_off(self) -> None:
        super().power_off()
        self._reset_axes()

    def entered(self, state: AlState, before: AlState) -> None:
        super().entered(state, before)
        if before is AlState.OP:  # no process data any more
            for drive in self.drives:
                if drive.state.name in _POWERED:
                    drive.connection_lost()

    def process_outputs(self, period_s: float) -> None:
        for drive in self.drives:
            drive.sync(period_s)

    def update_inputs(self, period_s: float) -> None:
        for drive in self.drives:
            drive.sample(period_s)

    def period_s(self) -> float | None:
        """Interpolation period: SYNC0, else object 0x60C2; None if neither is set."""
        clock, values = self.controller.clock, self.objects.values
        if clock.sync0_active and clock.sync0_cycle_ns:
            return clock.sync0_cycle_ns * 1e-9
        value = values.get((0x60C2, 1), 0)
        return float(value * 10.0 ** values.get((0x60C2, 2), -3)) if value else None

    def _reset_axes(self) -> None:
        for drive in self.drives:
            drive.power_on()

    def _axis(self, words: Sequence[str]) -> Drive:
        return self.drives[int(words[0]) if words else 0]

    def _trip(self, words: list[str]) -> None:
        code = int(words[0], 0) if words else _OVER_VOLTAGE
        for drive in [self._axis(words[1:])] if words[1:] else self.drives:
            drive.trip(code)

    def _press(self, words: list[str]) -> None:
        self._axis(words[2:]).press(int(words[0]), pressed=bool(int(words[1])))

    def _statusword(self, words: list[str]) -> None:
        self.faults.statusword = int(words[0], 0)

    def _mode(self, words: list[str]) -> None:
        self.faults.mode = int(words[0], 0)

    def _block(self, words: list[str]) -> None:
        self.faults.blocked = True


def _objects(offsets: Sequence[int]) -> list[ObjectDefinition]:
    """Return the dictionary of a drive with axes at ``offsets``."""
    found = [
        variable(0x1000, "Device type", DataType.UNSIGNED32, _SERVO_DRIVE),
        assignment(0x1C12, [0x1600 + offset * _PDO_STEP for offset in offsets]),
        assignment(0x1C13, [0x1A00 + offset * _PDO_STEP for offset in offsets]),
    ]
    for offset in offsets:
        for index, (name, mapping) in {**_RX, **_TX}.items():
            moved = [(entry + offset * _AXIS_STEP, sub, bits) for entry, sub, bits in mapping]
            found.append(pdo(index + offset * _PDO_STEP, name, moved))
        found += _profile_objects(offset)
    return found


def _profile_objects(offset: int) -> list[ObjectDefinition]:
    by_index: dict[int, list[DriveObject]] = {}
    for entry in DRIVE_OBJECTS:
        by_index.setdefault(entry.index, []).append(entry)
    definitions = []
    for index, parts in by_index.items():
        entries = {part.sub: _entry(part) for part in parts}
        code = ObjectCode.VAR if len(parts) == 1 else ObjectCode.RECORD
        definitions.append(
            ObjectDefinition(index + offset * _AXIS_STEP, code, parts[0].name, entries)
        )
    return definitions


def _entry(part: DriveObject) -> Entry:
    mappable = Access.RX_PDO | Access.TX_PDO if part.writable else Access.TX_PDO
    access = (READ_WRITE if part.writable else READ_ONLY) | mappable
    return Entry(_KINDS[part.kind], access, part.default, part.name)
