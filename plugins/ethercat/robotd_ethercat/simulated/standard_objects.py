"""Objects that every simulated slave has, and helpers for PDO objects (ETG.1000.6, ETG.1020)."""

from __future__ import annotations

from collections.abc import Sequence

from robotd_ethercat.simulated.object_dictionary import (
    CONFIGURATION,
    READ_ONLY,
    READ_WRITE,
    DataType,
    Entry,
    ObjectDefinition,
    record,
    variable,
)
from robotd_ethercat.simulated.sii_content import Identity

ERROR_SETTINGS = 0x10F1
_SYNC_ERROR_LIMIT = 0  # patient: stalls of the computer are no errors
_MAX_PDOS, _MAX_ENTRIES = 4, 16

Mapping = Sequence[tuple[int, int, int]]  # index, subindex, bits


def standard_objects(identity: Identity, name: str) -> list[ObjectDefinition]:
    """Return error register, names, identity and synchronisation objects."""
    unsigned32, unsigned16 = DataType.UNSIGNED32, DataType.UNSIGNED16
    parts = (
        ("Vendor ID", identity.vendor_id),
        ("Product code", identity.product_code),
        ("Revision number", identity.revision),
        ("Serial number", identity.serial),
    )
    kinds = (1, 2, 3, 4)  # mailbox out, mailbox in, outputs, inputs
    return [
        variable(0x1001, "Error register", DataType.UNSIGNED8),
        variable(0x1008, "Device name", DataType.VISIBLE_STRING, name.encode()),
        variable(0x1009, "Hardware version", DataType.VISIBLE_STRING, b"1.0"),
        variable(0x100A, "Software version", DataType.VISIBLE_STRING, b"1.0"),
        record(0x1018, "Identity", *[Entry(unsigned32, READ_ONLY, n, text) for text, n in parts]),
        record(
            ERROR_SETTINGS,
            "Error settings",
            Entry(unsigned32, READ_WRITE, 1, "Local error reaction"),
            Entry(unsigned16, READ_WRITE, _SYNC_ERROR_LIMIT, "Sync error counter limit"),
        ),
        record(
            0x1C00,
            "SyncManager type",
            *[Entry(DataType.UNSIGNED8, READ_ONLY, kind, f"SM{kind - 1}") for kind in kinds],
        ),
        *[_synchronisation(index) for index in (0x1C32, 0x1C33)],
    ]


def pdo(index: int, name: str, mapping: Mapping) -> ObjectDefinition:
    """Make a mapping object whose entries can be changed in PreOp."""
    values = [found << 16 | sub << 8 | bits for found, sub, bits in mapping]
    return _list(index, name, DataType.UNSIGNED32, values, max(_MAX_ENTRIES, len(values)))


def assignment(index: int, pdos: Sequence[int]) -> ObjectDefinition:
    """Make object 0x1C12 or 0x1C13, which can be changed in PreOp."""
    name = "RxPDO assign" if index == 0x1C12 else "TxPDO assign"
    return _list(index, name, DataType.UNSIGNED16, pdos, max(_MAX_PDOS, len(pdos)))


def _list(
    index: int, name: str, kind: DataType, values: Sequence[int], length: int
) -> ObjectDefinition:
    entries = [
        Entry(kind, CONFIGURATION, values[n] if n < len(values) else 0, f"Entry {n + 1}")
        for n in range(length)
    ]
    found = record(index, name, *entries, count_access=CONFIGURATION)
    found.entries[0] = Entry(DataType.UNSIGNED8, CONFIGURATION, len(values), "Number of entries")
    return found


def _synchronisation(index: int) -> ObjectDefinition:
    """Make object 0x1C32 or 0x1C33 with the entries up to the minimum cycle time."""
    unsigned16, unsigned32 = DataType.UNSIGNED16, DataType.UNSIGNED32
    return record(
        index,
        "SM output parameter" if index == 0x1C32 else "SM input parameter",
        Entry(unsigned16, READ_WRITE, 1, "Synchronization type"),
        Entry(unsigned32, READ_WRITE, 0, "Cycle time"),
        Entry(unsigned32, READ_ONLY, 0, "Shift time"),
        Entry(unsigned16, READ_ONLY, 0x0007, "Synchronization types supported"),
        Entry(unsigned32, READ_ONLY, 250_000, "Minimum cycle time"),
    )
