"""Generic slave: inputs repeat the outputs, objects to read and write."""

from __future__ import annotations

from robotd_ethercat.simulated.object_dictionary import (
    READ_ONLY,
    READ_WRITE,
    Access,
    DataType,
    Entry,
    record,
    variable,
)
from robotd_ethercat.simulated.sii_content import Identity
from robotd_ethercat.simulated.simulated_slave import Slave
from robotd_ethercat.simulated.standard_objects import assignment, pdo

VENDOR = 0x52424F54
GENERIC = Identity(VENDOR, 1)
_LONG = 512  # bytes of object 0x2001


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
