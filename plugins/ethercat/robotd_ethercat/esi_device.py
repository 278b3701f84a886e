"""Devices as ESI files describe them: PDOs, clocks, names of objects, modules in slots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from robotd.api import DescriptorError
from robotd_ethercat.mapping import Assignment

MAX_PARTS = 100_000  # objects and PDO entries of one device, with its modules
MAX_SHOWN = 40  # characters of a value in an error

Names = Mapping[tuple[int, int], str]


@dataclass(frozen=True)
class EsiEntry:
    """One object in a PDO; index 0 is a gap.

    ``on_slot``: its index moves with the slot of a module.
    """

    index: int
    sub: int
    bits: int
    name: str
    on_slot: bool = False


@dataclass(frozen=True)
class EsiPdo:
    """One PDO.

    Attributes:
        is_assigned: in the default assignment.
        is_fixed: its contents cannot be changed.
        excluded: PDOs that cannot be assigned together with it.
        on_slot: its index moves with the slot of a module.
    """

    assignment: Assignment
    index: int
    name: str
    is_assigned: bool
    is_fixed: bool
    excluded: frozenset[int]
    entries: tuple[EsiEntry, ...]
    on_slot: bool = False


@dataclass(frozen=True)
class EsiClock:
    """One operation mode of the distributed clock; ``activate`` 0: free run, or SM event."""

    name: str
    activate: int
    shift_ns: int


@dataclass(frozen=True)
class EsiSlot:
    """One slot of a modular device.

    Attributes:
        module: that it has by default; None where nothing is plugged in.
        index_step, pdo_step: by which indexes of objects, and of PDOs, differ from those of the
            slot before.
    """

    name: str
    module: int | None
    index_step: int = 0
    pdo_step: int = 0


@dataclass(frozen=True)
class EsiModule:
    """One module of a modular device."""

    ident: int
    name: str
    pdos: tuple[EsiPdo, ...]
    names: Names


@dataclass(frozen=True)
class EsiDevice:
    """One device in one revision.

    Attributes:
        product, revision: product code and revision number.
        profiles: numbers of its profiles, such as 402.
        can_assign, can_map: the assignment, and the contents of PDOs, can be written.
        clocks: operation modes, the default first.
        slots: in which modules are plugged; none of most devices.
        names: of objects, by index and subindex.
    """

    path: Path
    vendor: int
    vendor_name: str
    product: int
    revision: int
    name: str
    profiles: tuple[int, ...]
    can_assign: bool
    can_map: bool
    pdos: tuple[EsiPdo, ...]
    clocks: tuple[EsiClock, ...]
    names: Names
    slots: tuple[EsiSlot, ...] = ()
    modules: tuple[EsiModule, ...] = field(default=(), repr=False)

    def object_name(self, index: int, sub: int) -> str:
        """Return the name of an object, also as a PDO names it; "" without one."""
        if name := self.names.get((index, sub)):
            return name
        entries = (entry for pdo in self.pdos for entry in pdo.entries)
        found = (entry.name for entry in entries if (entry.index, entry.sub) == (index, sub))
        return next(found, "")


def with_modules(device: EsiDevice, modules: Mapping[int, EsiModule]) -> EsiDevice:
    """Return ``device`` with the PDOs and names of the default modules, moved to their slots."""
    pdos, names = list(device.pdos), dict(device.names)
    plugged: list[EsiModule] = []
    parts = len(names)
    for number, slot in enumerate(device.slots):
        if slot.module is None or (module := modules.get(slot.module)) is None:
            continue
        plugged.append(module)
        index_step, pdo_step = number * slot.index_step, number * slot.pdo_step
        parts += len(module.names) + sum(len(pdo.entries) for pdo in module.pdos)
        if parts > MAX_PARTS:
            what = f"more than {MAX_PARTS:_} objects in the modules of {device.name[:MAX_SHOWN]!r}"
            raise DescriptorError(what, path=device.path)
        pdos += [_moved(pdo, index_step, pdo_step) for pdo in module.pdos]
        names |= {(index + index_step, sub): name for (index, sub), name in module.names.items()}
    return replace(device, pdos=tuple(pdos), names=names, modules=tuple(plugged))


def _moved(pdo: EsiPdo, index_step: int, pdo_step: int) -> EsiPdo:
    entries = (
        replace(entry, index=entry.index + index_step) if entry.on_slot else entry
        for entry in pdo.entries
    )
    index = pdo.index + (pdo_step if pdo.on_slot else 0)
    excluded = frozenset(one + (pdo_step if pdo.on_slot else 0) for one in pdo.excluded)
    return replace(pdo, index=index, excluded=excluded, entries=tuple(entries))
