"""Reader of EDS and DCF files (CiA 306-1), which become object dictionaries.

That of the CANopen library refuses one real file in eight: 8-bit texts, ``[DummyUsage]`` that is
not complete, empty and zero-padded numbers; and its errors have no line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from canopen.objectdictionary import ObjectDictionary as Dictionary
from canopen.objectdictionary import ODArray, ODRecord, ODVariable
from canopen.objectdictionary.datatypes import (
    BOOLEAN,
    DOMAIN,
    FLOAT_TYPES,
    INTEGER_TYPES,
    UNSIGNED8,
)

from robotd.api import DescriptorError

MAX_SHOWN = 40  # characters of a value
_VAR, _ARRAY = 7, 8  # kinds of objects; without ObjectType it is a variable
_DOMAIN_OBJECT = 2
_DEFINED = range(0x01, 0x1C)  # data types of CiA 301
_DUMMIES = range(1, 8)
_LINE_END = re.compile(r"\r\n|\r|\n")
_SECTION = re.compile(r"\[([^\]]+)\]")
_ENTRY = re.compile(r"([^=:;\[][^=:;]*)[=:](.*)")
_COMMENT = re.compile(r"\s;")
_INDEX = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?")
_BAUD_RATE = re.compile(r"baudrate_([0-9]{2,4})")
_FLOAT = re.compile(r"[+-]?([0-9]{1,40}\.?[0-9]{0,40}|\.[0-9]{1,40})([eE][+-]?[0-9]{1,3})?")
_NUMBER = re.compile(r"-?(0x[0-9a-f]{1,16}|[0-9]{1,20})")


@dataclass(frozen=True)
class _Entry:
    value: str
    line: int


@dataclass(frozen=True)
class _Section:
    name: str
    line: int
    entries: dict[str, _Entry] = field(default_factory=dict)  # by the key in lower case

    def text(self, key: str) -> str:
        found = self.entries.get(key.lower())
        return "" if found is None else found.value


def parse_eds(data: bytes, path: Path, node: int) -> Dictionary:
    """Return the objects of ``node``. Raises DescriptorError with section, key and line.

    An object has the ``value`` that a DCF gives it; of an EDS it is None.
    """
    return _Reader(_sections(_decoded(data), path), path, node).dictionary()


def _decoded(data: bytes) -> str:
    """Decode UTF-16 with a mark, UTF-8, else Latin-1: tools write their code page."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _sections(text: str, path: Path) -> dict[str, _Section]:
    """Divide a text into sections, by their names in lower case."""
    sections: dict[str, _Section] = {}
    section: _Section | None = None
    for number, raw in enumerate(_LINE_END.split(text.partition("\x1a")[0]), start=1):
        line = raw.strip(" \t\0")
        if not line or line[0] in ";#":
            continue
        if head := _SECTION.match(line):
            name = head.group(1).strip()
            before = sections.get(name.lower())
            if before is not None and _INDEX.fullmatch(name.lower()):
                what = f"section [{name}] was given before, on line {before.line}"
                raise DescriptorError(what, path=path, line=number)
            sections[name.lower()] = section = before or _Section(name, number)
        elif (entry := _ENTRY.match(line)) and section is not None:
            key, value = entry.group(1).strip(), _COMMENT.split(entry.group(2), 1)[0].strip()
            earlier = section.entries.setdefault(key.lower(), _Entry(value, number))
            if earlier.value != value and _INDEX.fullmatch(section.name.lower()):
                what = f"{value[:MAX_SHOWN]!r}, and {earlier.value!r} on line {earlier.line}"
                raise DescriptorError(what, path=path, line=number, key=f"[{section.name}] {key}")
        elif section is None or section.name.lower() != "comments":
            what = f"neither a section nor key=value (value {line[:MAX_SHOWN]!r})"
            raise DescriptorError(what, path=path, line=number)
    return sections


class _Reader:
    """Makes a dictionary of sections; collects the problems."""

    def __init__(self, sections: Mapping[str, _Section], path: Path, node: int) -> None:
        self._sections, self._path, self._node = sections, path, node
        self._problems: list[DescriptorError] = []

    def dictionary(self) -> Dictionary:
        found = Dictionary()  # type: ignore[no-untyped-call]
        for dummy in self._dummies():
            found.add_object(dummy)
        subs: list[tuple[int, int, _Section]] = []
        for name, section in self._sections.items():
            if place := _INDEX.fullmatch(name):
                index = int(place.group(1), 16)
                if place.group(2) is None:
                    found.add_object(self._object(index, section))
                else:
                    subs.append((index, int(place.group(2), 16), section))
        for index, sub, section in subs:
            owner = found.indices.get(index)
            if owner is None or isinstance(owner, ODVariable):
                owner = ODRecord(f"0x{index:04X}" if owner is None else owner.name, index)
                found.add_object(owner)
            owner.add_member(self._variable(index, sub, section))
        self._describe_device(found)
        if self._problems:
            raise DescriptorError.join(self._problems)
        if not found.indices:
            raise DescriptorError("has no objects: it is no EDS", path=self._path)
        return found

    def _describe_device(self, found: Dictionary) -> None:
        """Add identity and bit rates, and the node that a DCF is for."""
        section = self._sections.get("deviceinfo", _Section("DeviceInfo", 0))
        device = found.device_information
        device.vendor_name, device.product_name = map(section.text, ("VendorName", "ProductName"))
        device.vendor_number = self._sum(section.text("VendorNumber"))
        device.product_number = self._sum(section.text("ProductNumber"))
        device.revision_number = self._sum(section.text("RevisionNumber"))
        for key, entry in section.entries.items():
            if (rate := _BAUD_RATE.fullmatch(key)) and self._sum(entry.value):
                device.allowed_baudrates.add(int(rate.group(1)) * 1000)
        for name in ("devicecomissioning", "devicecommissioning"):  # CiA 306 has one m
            if commissioned := self._sections.get(name):
                found.node_id = self._sum(commissioned.text("NodeID"))

    def _dummies(self) -> Iterator[ODVariable]:
        """Yield data types that may fill gaps in a PDO."""
        section = self._sections.get("dummyusage", _Section("DummyUsage", 0))
        for number in _DUMMIES:
            key = f"Dummy{number:04d}"
            if self._number(section, key) == 1:
                dummy = ODVariable(key, number, 0)
                dummy.data_type, dummy.access_type = number, "const"
                yield dummy

    def _object(self, index: int, section: _Section) -> ODVariable | ODRecord | ODArray:
        name = section.text("ParameterName") or f"0x{index:04X}"
        kind = self._number(section, "ObjectType") or _VAR
        compact = self._number(section, "CompactSubObj")
        if compact or section.name.lower() + "sub0" in self._sections:
            owner = ODArray(name, index) if kind == _ARRAY else ODRecord(name, index)
            for sub in range(min(compact, 0xFE) + 1 if compact else 0):
                owner.add_member(self._compact(index, sub, section))
            return owner
        if kind in (_VAR, _DOMAIN_OBJECT):
            return self._variable(index, 0, section)
        return ODArray(name, index) if kind == _ARRAY else ODRecord(name, index)

    def _compact(self, index: int, sub: int, section: _Section) -> ODVariable:
        """Return one of equal subindices, which have no sections of their own."""
        if sub == 0:
            count = ODVariable("Number of entries", index, 0)
            count.data_type, count.access_type = UNSIGNED8, "ro"
            count.default = self._number(section, "CompactSubObj")
            return count
        names = self._sections.get(f"{index:04x}name")
        name = names.text(str(sub)) if names else ""
        made = self._variable(index, sub, section)
        made.name = name or f"{made.name} {sub}"
        if values := self._sections.get(f"{index:04x}value"):
            made.value = self._value(values, str(sub), made.data_type)
        return made

    def _variable(self, index: int, sub: int, section: _Section) -> ODVariable:
        made = ODVariable(section.text("ParameterName") or f"0x{index:04X}:{sub:02X}", index, sub)
        made.data_type = self._data_type(section)
        made.access_type = (section.text("AccessType") or "rw").lower()
        made.pdo_mappable = bool(self._number(section, "PDOMapping"))
        if made.data_type in INTEGER_TYPES:
            made.default = self._sum(section.text("DefaultValue"))
        made.value = self._value(section, "ParameterValue", made.data_type)
        return made

    def _value(self, section: _Section, key: str, data_type: int | None) -> Any:
        """Return a value of a DCF; None without one. Texts stay texts."""
        text = section.text(key)
        if not text or data_type not in (*INTEGER_TYPES, *FLOAT_TYPES, BOOLEAN):
            return text or None
        value: float | None = self._sum(text)
        if data_type in FLOAT_TYPES and "x" not in text.lower():
            value = float(text) if _FLOAT.fullmatch(text) else None
        if value is None:
            self._problem(section, key, f"{text[:MAX_SHOWN]!r} is not a number")
        return value

    def _data_type(self, section: _Section) -> int:
        """Return the data type; an object defines one of the manufacturer."""
        if self._number(section, "ObjectType") == _DOMAIN_OBJECT:
            return DOMAIN
        if not section.text("DataType"):
            self._problem(section, "DataType", "missing")
            return DOMAIN
        number = self._number(section, "DataType")
        if number in _DEFINED:
            return number
        for name in (f"{number:x}sub1", f"{number:04x}sub1"):
            if (own := self._sections.get(name)) is not None:
                return self._number(own, "DefaultValue") or DOMAIN
        return DOMAIN

    def _number(self, section: _Section, key: str) -> int:
        """Return a number; 0 where it is missing or empty."""
        text = section.text(key)
        number = self._sum(text)
        if number is None and text:
            self._problem(section, key, f"{text[:MAX_SHOWN]!r} is not a number")
        return number or 0

    def _sum(self, text: str) -> int | None:
        """Return the value of ``$NODEID+0x180``; None where that is no sum of numbers."""
        total = 0
        for part in re.sub(r"\s", "", text).lower().removeprefix("+").split("+"):
            if part == "$nodeid":
                total += self._node
            elif _NUMBER.fullmatch(part):
                total += _integer(part)
            else:
                return None
        return total

    def _problem(self, section: _Section, key: str, what: str) -> None:
        entry = section.entries.get(key.lower())
        line = section.line if entry is None else entry.line
        place = f"[{section.name}] {key}"
        self._problems.append(DescriptorError(what, path=self._path, line=line, key=place))


def _integer(text: str) -> int:
    """Read a number of CiA 306: 0x is hexadecimal, a leading 0 octal."""
    digits = text.removeprefix("-")
    if digits.startswith("0x"):
        return int(text, 16)
    is_octal = digits.startswith("0") and not set(digits) & {"8", "9"}
    return int(text, 8 if is_octal else 10)
