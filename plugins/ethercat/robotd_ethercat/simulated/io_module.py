"""Digital I/O module: bytes of inputs and outputs."""

from __future__ import annotations

from robotd_ethercat.simulated.al_state import AlState
from robotd_ethercat.simulated.object_dictionary import (
    READ_ONLY,
    READ_WRITE,
    Access,
    DataType,
    Entry,
    ObjectDefinition,
    record,
    variable,
)
from robotd_ethercat.simulated.sii_content import Identity
from robotd_ethercat.simulated.simulated_slave import Command, Slave
from robotd_ethercat.simulated.standard_objects import assignment, pdo

_MODULE = 0x0003_0191  # device type: profile 401, digital inputs and outputs
_OUTPUTS, _INPUTS = 0x7000, 0x6000
_PDO_BYTES = 64
_OBJECT_STEP = 0x10
VENDOR = 0x52424F54
GENERIC = Identity(VENDOR, 1)
_LONG = 512  # bytes of object 0x2001


class IoModule(Slave):
    """Module with ``input_bytes`` and ``output_bytes``; outputs are 0 outside Op."""

    def __init__(
        self,
        identity: Identity,
        input_bytes: int,
        output_bytes: int,
        now_ns: int,
        *,
        alias: int = 0,
    ) -> None:
        objects = [
            variable(0x1000, "Device type", DataType.UNSIGNED32, _MODULE),
            *_direction(0x1600, 0x1C12, _OUTPUTS, "Outputs", output_bytes, Access.RX_PDO),
            *_direction(0x1A00, 0x1C13, _INPUTS, "Inputs", input_bytes, Access.TX_PDO),
        ]
        super().__init__(identity, "Digital I/O", objects, now_ns, alias=alias)

    @property
    def commands(self) -> dict[str, Command]:
        return {"input": self._input, "output": self._output}

    def output(self, byte: int) -> int:
        """Return an output byte as it is now."""
        return self.objects.values[_place(_OUTPUTS, byte)]

    def set_input_bit(self, byte: int, bit: int, *, value: bool) -> None:
        """Change one input; the next frame brings it."""
        place = _place(_INPUTS, byte)
        before = self.objects.values[place]
        self.objects.values[place] = before & ~(1 << bit) | int(value) << bit
        self.put_inputs()

    def entered(self, state: AlState, before: AlState) -> None:
        super().entered(state, before)
        if before is AlState.OP:
            for index, sub in self.objects.values:
                if sub and _OUTPUTS <= index < 0x8000:
                    self.objects.values[index, sub] = 0

    def _input(self, words: list[str]) -> None:
        byte, bit, value = (int(word) for word in words)
        self.set_input_bit(byte, bit, value=bool(value))

    def _output(self, words: list[str]) -> str:
        byte, bit = (int(word) for word in words)
        return str(self.output(byte) >> bit & 1)


def _place(base: int, byte: int) -> tuple[int, int]:
    number, sub = divmod(byte, _PDO_BYTES)
    return base + number * _OBJECT_STEP, sub + 1


def _direction(
    first_pdo: int, assigned: int, base: int, name: str, size: int, access: Access
) -> list[ObjectDefinition]:
    """Return objects, PDOs and assignment of one direction; each PDO has at most 64 bytes."""
    found, pdos = [], []
    for number, start in enumerate(range(0, size, _PDO_BYTES)):
        count = min(_PDO_BYTES, size - start)
        index = base + number * _OBJECT_STEP
        entries = [
            Entry(DataType.UNSIGNED8, READ_ONLY | access, 0, f"{name} byte {start + n}")
            for n in range(count)
        ]
        found.append(record(index, name, *entries))
        found.append(pdo(first_pdo + number, name, [(index, n + 1, 8) for n in range(count)]))
        pdos.append(first_pdo + number)
    return [*found, assignment(assigned, pdos)]


class GenericSlave(Slave):
    """Slave with 8 bytes of outputs, which its 8 bytes of inputs repeat."""

    def __init__(self, now_ns: int, identity: Identity = GENERIC, alias: int = 0) -> None:
        unsigned32 = DataType.UNSIGNED32
        outputs = [Entry(unsigned32, READ_ONLY | Access.RX_PDO, 0, f"Output {n}") for n in (1, 2)]
        inputs = [Entry(unsigned32, READ_ONLY | Access.TX_PDO, 0, f"Input {n}") for n in (1, 2)]
        objects = [
            variable(0x1000, "Device type", unsigned32),
            pdo(0x1600, "Outputs", [(0x7000, 1, 32), (0x7000, 2, 32)]),
            pdo(0x1A00, "Inputs", [(0x6000, 1, 32), (0x6000, 2, 32)]),
            assignment(0x1C12, [0x1600]),
            assignment(0x1C13, [0x1A00]),
            variable(0x2000, "Value", unsigned32, 0, READ_WRITE),
            variable(0x2001, "Long value", DataType.OCTET_STRING, bytes(_LONG), READ_WRITE),
            record(0x6000, "Inputs", *inputs),
            record(0x7000, "Outputs", *outputs),
        ]
        super().__init__(identity, "Generic slave", objects, now_ns, alias=alias)

    def process_outputs(self, period_s: float) -> None:
        values = self.objects.values
        for sub in (1, 2):
            values[0x6000, sub] = values[0x7000, sub]
