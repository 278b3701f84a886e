"""SII: contents of the EEPROM of a slave, made from its identity and object dictionary."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from robotd_ethercat.simulated.object_dictionary import ObjectDictionary

_STRINGS, _GENERAL, _FMMU, _SYNC_MANAGERS, _TX_PDO, _RX_PDO, _END = 10, 30, 40, 41, 50, 51, 0xFFFF
_COE = 0x0004  # mailbox protocol
_COE_DETAILS = 0x2F  # SDO, SDO information, PDO assignment and configuration, complete access
_SIZE = 4096  # bytes: 32 kbit
_HEADER = 0x80  # bytes before the first category
_VENDOR = 0x10  # byte address of vendor, product, revision and serial number

MAILBOX_OUT, MAILBOX_IN, OUTPUTS, INPUTS = 0x1000, 0x1400, 0x1800, 0x2400
_CONTROL = {MAILBOX_OUT: 0x26, MAILBOX_IN: 0x22, OUTPUTS: 0x64, INPUTS: 0x20}


@dataclass(frozen=True)
class Identity:
    """Identity of a slave: SII and object 0x1018."""

    vendor_id: int
    product_code: int
    revision: int = 1
    serial: int = 0


@dataclass(frozen=True)
class Hardware:
    """Data of the EEPROM that the object dictionary does not have.

    Attributes:
        name: order number and name.
        mailbox_bytes: length of each mailbox.
        output_bytes, input_bytes: default lengths of SM2 and SM3.
        alias: configured station alias, 0 for none.
    """

    name: str
    mailbox_bytes: int
    output_bytes: int
    input_bytes: int
    alias: int = 0


def sii_image(identity: Identity, hardware: Hardware, objects: ObjectDictionary) -> bytearray:
    """Return the EEPROM contents."""
    strings = _Strings(hardware.name)
    pdos = _pdos(objects, strings)
    body = b"".join(
        [
            _category(_GENERAL, _general()),
            _category(_FMMU, bytes([1, 2])),
            _category(_SYNC_MANAGERS, _sync_managers(hardware)),
            *pdos,
        ]
    )
    body = _category(_STRINGS, strings.data()) + body + struct.pack("<H", _END)
    image = bytearray((_header(identity, hardware) + body).ljust(_SIZE, b"\xff"))
    image[14:16] = struct.pack("<H", _checksum(image[:14]))
    return image


def change_identity(image: bytearray, identity: Identity) -> None:
    """Replace the identity in an image."""
    parts = identity.vendor_id, identity.product_code, identity.revision, identity.serial
    struct.pack_into("<4I", image, _VENDOR, *parts)


class _Strings:
    """String category: numbered from 1, 0 is none."""

    def __init__(self, *texts: str) -> None:
        self._texts = list(texts)

    def number(self, text: str) -> int:
        if text not in self._texts:
            self._texts.append(text)
        return self._texts.index(text) + 1

    def data(self) -> bytes:
        texts = [text.encode("ascii", "replace")[:255] for text in self._texts]
        return bytes([len(texts)]) + b"".join(bytes([len(text)]) + text for text in texts)


def _header(identity: Identity, hardware: Hardware) -> bytes:
    head = bytearray(_HEADER)
    struct.pack_into("<3H", head, 0, 0x0C08, 0x0000, 0x0000)  # PDI control and configuration
    struct.pack_into("<H", head, 8, hardware.alias)
    change_identity(head, identity)
    size = hardware.mailbox_bytes
    struct.pack_into("<4H", head, 0x30, MAILBOX_OUT, size, MAILBOX_IN, size)
    struct.pack_into("<H", head, 0x38, _COE)
    struct.pack_into("<2H", head, 0x7C, _SIZE * 8 // 1024 - 1, 1)  # size in kbit - 1, version
    return bytes(head)


def _general() -> bytes:
    data = bytearray(32)
    data[0] = data[2] = data[3] = 1  # group, order number, name
    data[5] = _COE_DETAILS
    struct.pack_into("<H", data, 16, 0x0011)  # ports 0 and 1: MII
    return bytes(data)


def _sync_managers(hardware: Hardware) -> bytes:
    areas = (
        (MAILBOX_OUT, hardware.mailbox_bytes),
        (MAILBOX_IN, hardware.mailbox_bytes),
        (OUTPUTS, hardware.output_bytes),
        (INPUTS, hardware.input_bytes),
    )
    return b"".join(
        struct.pack("<HHBBBB", start, length, _CONTROL[start], 0, int(length > 0), kind)
        for kind, (start, length) in enumerate(areas, start=1)
    )


def _pdos(objects: ObjectDictionary, strings: _Strings) -> list[bytes]:
    values = objects.values
    found = []
    for category, assignment, manager in ((_RX_PDO, 0x1C12, 2), (_TX_PDO, 0x1C13, 3)):
        assigned = [values[assignment, sub] for sub in range(1, values[assignment, 0] + 1)]
        data = b"".join(_pdo(objects, strings, pdo, manager) for pdo in assigned)
        if data:
            found.append(_category(category, data))
    return found


def _pdo(objects: ObjectDictionary, strings: _Strings, index: int, manager: int) -> bytes:
    values = objects.values
    mapped = [values[index, sub] for sub in range(1, values[index, 0] + 1)]
    name = strings.number(objects.objects[index].name)
    data = struct.pack("<HBBBBH", index, len(mapped), manager, 0, name, 0)
    for mapping in mapped:
        entry = objects.entry(mapping >> 16, mapping >> 8 & 0xFF)
        kind = entry.kind if entry is not None else 0
        text = strings.number(entry.name) if entry is not None else 0
        sub, bits = mapping >> 8 & 0xFF, mapping & 0xFF
        data += struct.pack("<HBBBBH", mapping >> 16, sub, text, kind, bits, 0)
    return data


def _category(number: int, data: bytes) -> bytes:
    padded = data + b"\0" * (len(data) % 2)
    return struct.pack("<HH", number, len(padded) // 2) + padded


def _checksum(data: bytes | bytearray) -> int:
    """CRC-8 of the first seven words, polynomial 0x07, start value 0xFF."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07 if crc & 0x80 else crc << 1) & 0xFF
    return crc
