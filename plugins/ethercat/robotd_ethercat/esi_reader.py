"""Reader of ESI files (EtherCAT Slave Information, ETG.2000): devices with PDOs, clocks, names.

Values that no device needs to be recognised are read leniently: real files break the schema.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path, PureWindowsPath
from typing import Any, NoReturn

from lxml import etree

from robotd.api import DescriptorError, read_limited
from robotd_ethercat.esi_device import (
    MAX_PARTS,
    MAX_SHOWN,
    EsiClock,
    EsiDevice,
    EsiEntry,
    EsiModule,
    EsiPdo,
    EsiSlot,
    with_modules,
)
from robotd_ethercat.mapping import Assignment

MAX_BYTES = 32_000_000  # of a file; one of a series of terminals has 10 MB
MAX_SLOTS = 256
_ENGLISH = "1033"  # LcId
_NUMBER = re.compile(r"(?:[#0][xX]([0-9A-Fa-f]{1,16})|([0-9]{1,20}))")
_DIRECTIONS = {"RxPdo": Assignment.OUTPUTS, "TxPdo": Assignment.INPUTS}
MAX_FILES = 5000
MAX_NAMED = 20  # products in an error


def read_esi(path: Path, wanted: Collection[tuple[int, int]] | None = None) -> list[EsiDevice]:
    """Return the devices of a file. Raises DescriptorError.

    Args:
        wanted: (vendor, product) of the devices that are read; None: all.
    """
    reader = _Reader(path, wanted)
    reader.read(path, "EtherCATInfo")
    for file in reader.module_files():
        reader.read(file, "EtherCATModule")
    return list(reader.devices())


class _Reader:
    """Makes devices and modules of the elements, which it clears."""

    def __init__(self, path: Path, wanted: Collection[tuple[int, int]] | None) -> None:
        self._path, self._wanted = path, wanted
        self._vendor, self._vendor_name = 0, ""
        self._references: list[str] = []
        self._devices: list[EsiDevice] = []
        self._modules: dict[int, EsiModule] = {}

    def read(self, path: Path, tag: str) -> None:
        """Take the elements of a file with the root ``tag``. Raises DescriptorError."""
        self._path = path
        data = read_limited(path, MAX_BYTES)
        if b"<!DOCTYPE" in data:
            raise DescriptorError("a DOCTYPE is not allowed", path=path)
        events = etree.iterparse(
            BytesIO(data),
            tag=("InfoReference", "Vendor", "Device", "Module"),
            resolve_entities=False,
            load_dtd=False,
            no_network=True,
            huge_tree=False,
            remove_comments=True,
            remove_pis=True,
        )
        try:
            for _, element in events:
                self.take(element)
        except etree.XMLSyntaxError as error:
            what = f"not valid XML: {error.msg}"
            raise DescriptorError(what, path=path, line=error.lineno or None) from None
        root: Any = events.root
        if root.getroottree().docinfo.doctype:
            raise DescriptorError("a DOCTYPE is not allowed", path=path)
        if root.tag != tag:
            what = f"is no ESI: the root is {str(root.tag)[:MAX_SHOWN]!r}, not {tag!r}"
            raise DescriptorError(what, path=path)

    def module_files(self) -> list[Path]:
        """Return the files with modules that the ESI refers to, where a device has slots.

        They are in the folder of the ESI or below, or with their name beside it.
        """
        if not any(device.slots for device in self._devices):
            return []
        folder = self._path.parent
        found: dict[Path, None] = {}
        for reference in self._references:
            parts = PureWindowsPath(reference).parts  # they have backslashes, rarely slashes
            places = (folder.joinpath(*parts), folder / parts[-1]) if parts else ()
            if ".." not in parts and (file := next(filter(os.path.isfile, places), None)):
                found[file] = None
        return list(found)

    def take(self, element: Any) -> None:
        parent = element.getparent()
        place = None if parent is None else parent.tag
        match element.tag, place:
            case "InfoReference", "EtherCATInfo":
                self._references.append(_text(element))
            case "Vendor", "EtherCATInfo":
                self._vendor = self._number(element, "Id")
                self._vendor_name = _name(element)
            case "Device", "Devices":
                product = self._attribute(element.find("Type"), "ProductCode")
                if self._wanted is None or (self._vendor, product) in self._wanted:
                    self._devices.append(self._device(element, product))
                element.clear()
            case "Module", "Modules":
                if any(device.slots for device in self._devices):
                    module = self._module(element)
                    self._modules[module.ident] = module
                element.clear()

    def devices(self) -> Iterator[EsiDevice]:
        """Yield the devices, with their default modules in their slots."""
        for device in self._devices:
            yield with_modules(device, self._modules)

    def _device(self, element: Any, product: int) -> EsiDevice:
        kind = element.find("Type")
        coe = element.find("Mailbox/CoE")
        slots = element.find("Slots")
        places = ("Profile/ProfileNo", "Profile/ChannelInfo/ProfileNo")
        profiles = [self._value(found) for place in places for found in element.iterfind(place)]
        return EsiDevice(
            path=self._path,
            vendor=self._vendor,
            vendor_name=self._vendor_name,
            product=product,
            revision=self._attribute(kind, "RevisionNo"),
            name=_name(element) or _text(kind),
            profiles=tuple(number & 0xFFFF for number in profiles if number),
            can_assign=coe is not None and _is_true(coe.get("PdoAssign")),
            can_map=coe is not None and _is_true(coe.get("PdoConfig")),
            pdos=self._pdos(element),
            clocks=tuple(self._clock(mode) for mode in element.iterfind("Dc/OpMode")),
            names=self._names(element),
            slots=tuple(self._slots(slots)) if slots is not None else (),
        )

    def _module(self, element: Any) -> EsiModule:
        kind = element.find("Type")
        return EsiModule(
            self._attribute(kind, "ModuleIdent"),
            _name(element) or _text(kind),
            self._pdos(element),
            self._names(element),
        )

    def _pdos(self, element: Any) -> tuple[EsiPdo, ...]:
        pdos = (child for child in element if child.tag in _DIRECTIONS)
        found = tuple(self._pdo(child) for child in pdos)
        self._limit(sum(len(pdo.entries) for pdo in found), element)
        return found

    def _pdo(self, element: Any) -> EsiPdo:
        return EsiPdo(
            assignment=_DIRECTIONS[element.tag],
            index=self._number(element, "Index"),
            name=_name(element),
            is_assigned=bool(element.get("Sm")),
            is_fixed=_is_true(element.get("Fixed")),
            excluded=frozenset(self._value(one) for one in element.iterfind("Exclude")),
            entries=tuple(self._entry(entry) for entry in element.iterfind("Entry")),
            on_slot=_on_slot(element),
        )

    def _entry(self, element: Any) -> EsiEntry:
        index, sub = self._number(element, "Index"), self._number(element, "SubIndex")
        bits = self._number(element, "BitLen")
        return EsiEntry(index, sub, bits, _name(element), _on_slot(element))

    def _clock(self, element: Any) -> EsiClock:
        shift = _text(element.find("ShiftTimeSync0"))
        number = int(shift) if re.fullmatch(r"-?[0-9]{1,12}", shift) else 0
        return EsiClock(_name(element), self._number(element, "AssignActivate"), number)

    def _slots(self, element: Any) -> Iterator[EsiSlot]:
        count = 0
        for slot in element.iterfind("Slot"):
            idents = slot.findall("ModuleIdent")
            chosen = [one for one in idents if _is_true(one.get("Default"))] or idents
            least = self._attribute(slot, "MinInstances")
            most = max(1, self._attribute(slot, "MaxInstances"), least)
            steps = [
                self._attribute(slot if slot.get(step) else element, step)
                for step in ("SlotIndexIncrement", "SlotPdoIncrement")
            ]
            count += most
            if count > MAX_SLOTS:
                self._refuse(slot, f"more than {MAX_SLOTS} slots")
            for place in range(most):
                plugged = place < least and chosen
                module = self._value(chosen[0]) if plugged else None
                yield EsiSlot(_name(slot), module, *steps)

    def _names(self, element: Any) -> dict[tuple[int, int], str]:
        """Return the names of objects, of the dictionary inside the file."""
        names: dict[tuple[int, int], str] = {}
        for profile in element.iterfind("Profile"):
            types = {
                _text(kind.find("Name")): [
                    (self._number(sub, "SubIdx"), _name(sub)) for sub in kind.iterfind("SubItem")
                ]
                for kind in profile.iterfind("Dictionary/DataTypes/DataType")
            }
            objects = [
                *profile.iterfind("Dictionary/Objects/Object"),
                *profile.iterfind("Objects/Object"),
            ]
            for found in objects:
                index, name = self._number(found, "Index"), _name(found)
                names[index, 0] = name
                for sub, part in types.get(_text(found.find("Type")), ()):
                    if sub:
                        names[index, sub] = f"{name}: {part}"
                self._limit(len(names), element)
        return names

    def _limit(self, count: int, element: Any) -> None:
        if count > MAX_PARTS:
            self._refuse(element, f"more than {MAX_PARTS:_} objects in {element.tag}")

    def _number(self, element: Any, tag: str) -> int:
        """Return the number in a child; 0 without one."""
        child = element.find(tag)
        return self._value(child) if child is not None else 0

    def _value(self, element: Any) -> int:
        return self._parse(_text(element), element, element.tag)

    def _attribute(self, element: Any, name: str) -> int:
        text = element.get(name) if element is not None else None
        return self._parse(text.strip(), element, f"{element.tag}/@{name}") if text else 0

    def _parse(self, text: str, element: Any, place: str) -> int:
        if not text:
            return 0
        found = _NUMBER.fullmatch(text)
        if found is None:
            self._refuse(element, f"{place}: {text[:MAX_SHOWN]!r} is not a number")
        return int(found.group(1), 16) if found.group(1) else int(found.group(2))

    def _refuse(self, element: Any, what: str) -> NoReturn:
        raise DescriptorError(what, path=self._path, line=element.sourceline or None)


def _text(element: Any) -> str:
    """Return the text of an element; "" without one."""
    return "" if element is None else (element.text or "").strip()


def _name(element: Any) -> str:
    """Return the name of an element, the English one if there are several."""
    names = element.findall("Name")
    english = [name for name in names if name.get("LcId") == _ENGLISH]
    found: Sequence[Any] = english or names
    return " ".join(_text(found[0]).split()) if found else ""


def _is_true(text: str | None) -> bool:
    return text is not None and text.strip().lower() in ("1", "true")


def _on_slot(element: Any) -> bool:
    index = element.find("Index")
    return index is not None and _is_true(index.get("DependOnSlot"))


class EsiLibrary:
    """Devices by vendor, product and revision.

    Attributes:
        problems: files that cannot be read, which are left out.
    """

    def __init__(self, path: Path, wanted: Collection[tuple[int, int]]) -> None:
        """Read the devices ``wanted``, as (vendor, product). Raises DescriptorError."""
        self.problems: list[str] = []
        self._devices: list[EsiDevice] = []
        for file in _files(path):
            try:
                if _mentions(read_limited(file, MAX_BYTES), wanted):
                    self._devices += read_esi(file, wanted)
            except DescriptorError as error:
                self.problems.append(str(error))

    def find(self, vendor: int, product: int, revision: int) -> EsiDevice | None:
        """Return the device in this revision, the newest before it, or the oldest."""
        found = [one for one in self._devices if (one.vendor, one.product) == (vendor, product)]
        found.sort(key=lambda one: one.revision)
        earlier = [one for one in found if one.revision <= revision]
        return earlier[-1] if earlier else found[0] if found else None


def of_products(
    devices: Sequence[EsiDevice], products: Iterable[int], path: Path
) -> list[EsiDevice]:
    """Return the newest revision of each product. Raises DescriptorError: a product is missing."""
    newest = {device.product: device for device in sorted(devices, key=lambda one: one.revision)}
    try:
        return [newest[product] for product in products]
    except KeyError as error:
        known = ", ".join(f"0x{product:08X}" for product in sorted(newest)[:MAX_NAMED]) or "none"
        what = f"has no product 0x{error.args[0]:08X} (available: {known})"
        raise DescriptorError(what, path=path) from None


def _files(path: Path) -> Iterator[Path]:
    if path.is_file():
        yield path
        return
    try:
        files = sorted(file for file in path.iterdir() if file.suffix.lower() == ".xml")
    except OSError as error:
        raise DescriptorError(f"cannot be read: {error.strerror}", path=path) from None
    if len(files) > MAX_FILES:
        what = f"has {len(files)} XML files, the limit is {MAX_FILES}"
        raise DescriptorError(what, path=path)
    yield from files


def _mentions(data: bytes, wanted: Collection[tuple[int, int]]) -> bool:
    """Return False for a file without any of the product codes."""
    if b"\0" in data[:200]:  # UTF-16
        return True
    text = data.lower()
    return any(b"%x" % product in text or b"%d" % product in text for _, product in wanted)
