"""Object dictionary of a CANopen device with its EDS, and its PDOs, after CiA 301 and CiA 306."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from tests.plugins.independent.canopen_device import CanopenDevice

DATA_TYPES = {"b": 2, "h": 3, "i": 4, "B": 5, "H": 6, "I": 7, "s": 9}
DUMMY_BITS = {2: 8, 3: 16, 4: 32, 5: 8, 6: 16, 7: 32}  # objects 0x0002..0x0007 fill RPDOs
SAVE, LOAD = 0x65766173, 0x64616F6C
INVALID, NO_RTR, EXTENDED = 1 << 31, 1 << 30, 1 << 29
MAPPED_OBJECTS = 8
MANDATORY = {0x1000, 0x1001, 0x1018}
ARRAYS = {0x1003, 0x1010, 0x1011, 0x1016, 0x607D, 0x6099}
STRING_BYTES = 64

TOGGLE = 0x0503_0000
UNKNOWN_COMMAND = 0x0504_0001
UNSUPPORTED_ACCESS = 0x0601_0000
WRITE_ONLY = 0x0601_0001
READ_ONLY = 0x0601_0002
NO_OBJECT = 0x0602_0000
NOT_MAPPABLE = 0x0604_0041
PDO_LENGTH = 0x0604_0042
INCOMPATIBLE = 0x0604_0043
WRONG_LENGTH = 0x0607_0010
TOO_LONG = 0x0607_0012
TOO_SHORT = 0x0607_0013
NO_SUBINDEX = 0x0609_0011
VALUE_RANGE = 0x0609_0030
CANNOT_STORE = 0x0800_0020
DEVICE_STATE = 0x0800_0022


class Abort(Exception):
    """SDO abort with its code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


EDS_HEAD = """\
[FileInfo]
FileName=cia402_node.eds
FileVersion=1
FileRevision=0
EDSVersion=4.0
Description=Independent CiA 402 drive for tests
CreationTime=12:00PM
CreationDate=11-25-2026
CreatedBy=tests

[DeviceInfo]
VendorName=Independent
VendorNumber=0x29C
ProductName=Independent CiA 402 drive
ProductNumber=402
RevisionNumber=0x10001
OrderCode=1
BaudRate_10=0
BaudRate_20=0
BaudRate_50=0
BaudRate_125=1
BaudRate_250=1
BaudRate_500=1
BaudRate_800=0
BaudRate_1000=1
SimpleBootUpMaster=0
SimpleBootUpSlave=1
Granularity=8
DynamicChannelsSupported=0
GroupMessaging=0
NrOfRXPDO=4
NrOfTXPDO=4
LSS_Supported=0

[DummyUsage]"""


class Stored(Exception):
    """The command was executed; the object keeps its value."""


@dataclass
class Entry:
    """Entry of the object dictionary; ``kind`` is a struct character or "s" for a string."""

    name: str
    kind: str
    value: int | str = 0
    access: str = "rw"
    pdo: str = ""  # "r" in RPDOs, "t" in TPDOs
    relative: bool = False  # the value contains the node id
    default: int | str = field(init=False)

    def __post_init__(self) -> None:
        self.default = self.value

    @property
    def size(self) -> int:
        return struct.calcsize(f"<{self.kind}")

    def encode(self) -> bytes:
        if isinstance(self.value, str):
            return self.value.encode()
        return (self.value & (1 << 8 * self.size) - 1).to_bytes(self.size, "little")

    def eds(self, node_id: int) -> list[str]:
        value = self.default
        if self.relative and isinstance(value, int):
            value = f"$NODEID+0x{value - node_id:X}"
        return [
            "ObjectType=0x7",
            f"DataType=0x{DATA_TYPES[self.kind]:04X}",
            f"AccessType={self.access}",
            f"DefaultValue={value}",
            f"PDOMapping={int(bool(self.pdo))}",
        ]

    def decode(self, data: bytes) -> int | str:
        if self.kind == "s":
            if len(data) > STRING_BYTES:
                raise Abort(TOO_LONG)
            return data.decode("latin-1")
        if len(data) != self.size:
            raise Abort(TOO_LONG if len(data) > self.size else TOO_SHORT)
        return int(struct.unpack(f"<{self.kind}", data)[0])


class ObjectDictionary:
    """Entries by index and sub-index, and the rules for reading and writing them."""

    def __init__(self) -> None:
        self.objects: dict[tuple[int, int], Entry] = {}
        self.names: dict[int, str] = {}
        self.hooks: dict[int, Callable[[int, int], None]] = {}  # called before a value is written
        self.writes: Counter[str] = Counter()  # SDO downloads, e.g. "6040:0"

    def __getitem__(self, key: int | tuple[int, int]) -> int:
        return cast("int", self.objects[key if key.__class__ is tuple else (key, 0)].value)

    def __setitem__(self, key: int | tuple[int, int], value: float) -> None:
        self.objects[key if key.__class__ is tuple else (key, 0)].value = round(value)

    def get(self, index: int, sub: int = 0, default: int = 0) -> int:
        entry = self.objects.get((index, sub))
        return default if entry is None else cast("int", entry.value)

    def add(self, index: int, name: str, *entries: Entry, subs: tuple[int, ...] = ()) -> None:
        """Add a variable (one entry without ``subs``) or a record with its sub-index 0."""
        self.names[index] = name
        if not subs and len(entries) == 1:
            self.objects[index, 0] = entries[0]
            return
        subs = subs or tuple(range(1, len(entries) + 1))
        self.objects[index, 0] = Entry("Highest sub-index supported", "B", max(subs), "const")
        self.objects.update({(index, s): e for s, e in zip(subs, entries, strict=True)})

    def remove(self, index: int, sub: int | None = None) -> None:
        for key in [k for k in self.objects if k[0] == index and sub in {None, k[1]}]:
            del self.objects[key]

    def find(self, index: int, sub: int) -> Entry:
        if (index, sub) in self.objects:
            return self.objects[index, sub]
        raise Abort(NO_SUBINDEX if (index, 0) in self.objects else NO_OBJECT)

    def put(self, index: int, sub: int, data: bytes) -> None:
        """Write a value, from an SDO or RPDO."""
        entry = self.find(index, sub)
        value = entry.decode(data)
        if index in self.hooks and isinstance(value, int):
            self.hooks[index](sub, value)
        entry.value = value

    def write(self, index: int, sub: int, data: bytes) -> None:
        self.writes[f"{index:04X}:{sub}"] += 1
        if self.find(index, sub).access in {"ro", "const"}:
            raise Abort(READ_ONLY)
        self.put(index, sub, data)

    def read(self, index: int, sub: int) -> bytes:
        entry = self.find(index, sub)
        if entry.access == "wo":
            raise Abort(WRITE_ONLY)
        return entry.encode()

    def eds(self, node_id: int) -> str:
        """Return the electronic data sheet (CiA 306) of a device whose node id is ``node_id``."""
        groups = {
            "MandatoryObjects": [i for i in self.names if i in MANDATORY],
            "OptionalObjects": [i for i in self.names if i not in MANDATORY and not is_own(i)],
            "ManufacturerObjects": [i for i in self.names if is_own(i)],
        }
        lines = EDS_HEAD.splitlines()
        lines += [f"Dummy{n:04d}={int(n in DUMMY_BITS)}" for n in range(1, 8)]
        for group, indexes in groups.items():
            lines += ["", f"[{group}]", f"SupportedObjects={len(indexes)}"]
            lines += [f"{n}=0x{index:04X}" for n, index in enumerate(sorted(indexes), 1)]
        for index in sorted(self.names):
            subs = sorted(sub for i, sub in self.objects if i == index)
            if subs == [0]:
                lines += ["", f"[{index:04X}]", f"ParameterName={self.names[index]}"]
                lines += self.objects[index, 0].eds(node_id)
                continue
            kind = 8 if index in ARRAYS else 9
            lines += ["", f"[{index:04X}]", f"ParameterName={self.names[index]}"]
            lines += [f"ObjectType=0x{kind:X}", f"SubNumber={len(subs)}"]
            for sub in subs:
                entry = self.objects[index, sub]
                lines += ["", f"[{index:04X}sub{sub:X}]", f"ParameterName={entry.name}"]
                lines += entry.eds(node_id)
        return "\n".join([*lines, ""])


class Pdo:
    """PDO with its communication and mapping objects."""

    def __init__(self, device: CanopenDevice, number: int, transmit: bool) -> None:
        self.device = device
        self.transmits = transmit
        self.communication = (0x1800 if transmit else 0x1400) + number
        self.mapping = self.communication + 0x200
        self.received: bytes | None = None  # by a synchronous RPDO, for the next SYNC
        self.sampled: bytes | None = None  # at a SYNC, for the next remote frame (type 252)
        self.sent: bytes | None = None
        self.sent_at = float("-inf")
        self.syncs = 0

    def restart(self) -> None:
        silent = self.transmits and not self.device.announces(self)
        self.sent = self.pack() if silent else None
        self.sent_at = self.device.now if silent else float("-inf")
        self.received = self.sampled = None
        self.syncs = 0

    @property
    def cob_id(self) -> int:
        return self.device[self.communication, 1]

    @property
    def valid(self) -> bool:
        return not self.cob_id & INVALID

    @property
    def type(self) -> int:
        return self.device[self.communication, 2]

    def objects(self) -> list[tuple[int, int, int]]:
        words = [self.device[self.mapping, sub + 1] for sub in range(self.device[self.mapping])]
        return [(word >> 16, word >> 8 & 0xFF, word & 0xFF) for word in words]

    def pack(self) -> bytes:
        return b"".join(self.device.objects[i, sub].encode() for i, sub, _ in self.objects())

    def unpack(self, data: bytes) -> list[tuple[int, int, bytes]]:
        values = []
        for index, sub, bits in self.objects():
            values.append((index, sub, data[: bits // 8]))
            data = data[bits // 8 :]
        return values

    def transmit(self, data: bytes) -> None:
        self.sent, self.sent_at = data, self.device.now
        if data:
            self.device.reported.update(index for index, _, _ in self.objects())
            self.device.transmit_pdo(self.cob_id & 0x7FF, data)

    def poll(self) -> None:
        """Send an event-driven TPDO whose data changed or whose event timer elapsed."""
        if not self.valid or self.type < 254:
            return
        data, age = self.pack(), self.device.now - self.sent_at
        timer = self.device.get(self.communication, 5) * 1e-3
        if (data != self.sent or (timer and age >= timer)) and (
            age >= self.device[self.communication, 3] * 1e-4
        ):
            self.transmit(data)

    def sync(self) -> None:
        """Sample or send a TPDO at a SYNC."""
        if not self.valid:
            return
        if self.type == 252:
            self.sampled = self.pack()
        elif self.type == 0:
            if self.pack() != self.sent:
                self.transmit(self.pack())
        elif self.type <= 240:
            self.syncs = (self.syncs + 1) % self.type
            if not self.syncs:
                self.transmit(self.pack())

    def request(self) -> None:
        """Answer a remote frame."""
        if not self.cob_id & NO_RTR:
            data = self.sampled if self.type == 252 else self.pack()
            if data is not None:
                self.transmit(data)

    def receive(self, data: bytes) -> None:
        length = sum(bits for _, _, bits in self.objects()) // 8
        if len(data) < length:
            self.device.emergency(0x8210, 0x10)
        elif self.type <= 240:
            self.received = data
        else:
            self.device.apply(self.unpack(data))

    def take(self) -> list[tuple[int, int, bytes]]:
        """Return the values that an RPDO has received for this SYNC."""
        data, self.received = self.received, None
        return [] if data is None or not self.valid else self.unpack(data)

    def map_default(self, *keys: tuple[int, int], valid: bool = True) -> None:
        """Set the default mapping."""
        self.device.objects[self.mapping, 0].default = len(keys)
        for sub, (index, s) in enumerate(keys, 1):
            word = index << 16 | s << 8 | 8 * self.device.objects[index, s].size
            self.device.objects[self.mapping, sub].default = word
        cob_id = self.device.objects[self.communication, 1]
        cob_id.default = self.cob_id & ~INVALID if valid else self.cob_id

    def check_communication(self, sub: int, value: int) -> None:
        if sub == 1:
            valid, changed = not value & INVALID, (value ^ self.cob_id) & 0x3FFF_FFFF
            if value & EXTENDED or (valid and is_restricted(value & 0x7FF)):
                raise Abort(VALUE_RANGE)
            if valid and self.valid and changed:
                raise Abort(VALUE_RANGE)  # bits 0 to 29 are fixed while the PDO is valid
            self.restart()
        elif (sub == 2 and 240 < value < (252 if self.transmits else 254)) or (
            sub == 3 and self.valid
        ):
            raise Abort(VALUE_RANGE)
        else:
            self.syncs = 0

    def check_mapping(self, sub: int, value: int) -> None:
        if self.valid or (sub and self.device[self.mapping]):
            raise Abort(UNSUPPORTED_ACCESS)
        if sub:
            self._check_mappable(value)
            return
        if value > MAPPED_OBJECTS:
            raise Abort(PDO_LENGTH)
        words = [self.device[self.mapping, n] for n in range(1, value + 1)]
        for word in words:
            self._check_mappable(word)
        if sum(word & 0xFF for word in words) > 64:
            raise Abort(PDO_LENGTH)

    def _check_mappable(self, word: int) -> None:
        index, sub, bits = word >> 16, word >> 8 & 0xFF, word & 0xFF
        if index in DUMMY_BITS and not sub and not self.transmits and bits == DUMMY_BITS[index]:
            return
        if (index, sub) not in self.device.objects:
            raise Abort(NO_OBJECT)
        entry = self.device.objects[index, sub]
        if ("t" if self.transmits else "r") not in entry.pdo or bits != 8 * entry.size:
            raise Abort(NOT_MAPPABLE)


def is_restricted(can_id: int) -> bool:
    """Return whether CiA 301 reserves the CAN-ID."""
    ranges = (0, 0x7F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF)
    return can_id >= 0x701 or any(first <= can_id <= last for first, last in ranges)


def is_own(index: int) -> bool:
    """Return whether the object belongs to the manufacturer."""
    return 0x2000 <= index < 0x6000
