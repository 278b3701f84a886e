"""PDOs and clocks of drives, chosen from their ESI, as keys of a descriptor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from robotd_cia402.drive_scan import MAX_AXES
from robotd_cia402.object_numbers import (
    CONTROLWORD,
    DEMAND,
    ERROR_CODE,
    MODE,
    SWITCHES,
    TARGET_POSITION,
    TARGET_VELOCITY,
    TORQUE,
    VELOCITY,
    on_axis,
)
from robotd_ethercat.esi_device import EsiDevice, EsiPdo
from robotd_ethercat.mapping import Assignment
from robotd_ethercat.plan import NEEDED_INPUTS, missing_text

_KEYS = {Assignment.OUTPUTS: "rx_pdos", Assignment.INPUTS: "tx_pdos"}
_USEFUL_INPUTS = (VELOCITY, TORQUE, ERROR_CODE, DEMAND, SWITCHES)
_MAX_TRIED = 32  # PDOs that a combination begins with
_SYNC0 = 1 << 8  # of AssignActivate: SYNC0 is generated (ETG.1000.4, register 0x0980)


def axis_offsets(device: EsiDevice) -> list[int]:
    """Return the axes of a drive, by the controlwords that its PDOs hold."""
    held = _objects(pdo for pdo in device.pdos if pdo.assignment is Assignment.OUTPUTS)
    return [offset for offset in range(MAX_AXES) if on_axis(CONTROLWORD, offset) in held]


def pdo_keys(device: EsiDevice, *, pv: bool) -> dict[int, dict[str, Any]]:
    """Return ``rx_pdos`` and ``tx_pdos`` by axis, where the default assignment will not do.

    Args:
        pv: velocity commands are given in profile velocity, which needs no 0x60FF in a frame.

    A ``remark`` says which objects no PDO holds.
    """
    offsets = axis_offsets(device) or [0]
    keys: dict[int, dict[str, Any]] = {offset: {} for offset in offsets}
    outputs: tuple[int, ...] = (CONTROLWORD, MODE, TARGET_POSITION)
    if _has_velocity(device, offsets):
        outputs += () if pv else (TARGET_VELOCITY,)
    else:
        what = "no PDO in the ESI holds 0x60FF: no velocity commands"
        keys = {offset: {"velocity_mode": "pv", "remark": what} for offset in offsets}
    for assignment, needed in ((Assignment.OUTPUTS, outputs), (Assignment.INPUTS, NEEDED_INPUTS)):
        pdos = [pdo for pdo in device.pdos if pdo.assignment is assignment]
        wanted = {offset: [on_axis(base, offset) for base in needed] for offset in offsets}
        default = _objects(pdo for pdo in pdos if pdo.is_assigned)
        if all(index in default for axis in wanted.values() for index in axis):
            continue
        taken: list[EsiPdo] = []
        assignable = [pdo for pdo in pdos if device.can_assign or pdo.is_assigned]
        for offset, indexes in wanted.items():
            chosen = _chosen(assignable, indexes, taken)
            missing = set(indexes) - _objects(chosen)
            if not missing:
                new = [pdo for pdo in chosen if pdo not in taken]
                keys[offset][_KEYS[assignment]] = [{"index": f"0x{pdo.index:04X}"} for pdo in new]
                taken += new
            elif (free := _writable(device, assignable, taken)) is not None:
                keys[offset][_KEYS[assignment]] = [_written(device, free, indexes, offset)]
                taken.append(free)
            else:
                lost = [base for base in needed if on_axis(base, offset) in missing]
                which = "no PDO" if device.can_assign else "no PDO of the constant assignment"
                text = f"{which} in the ESI holds {missing_text(lost, offset)}"
                keys[offset] = with_remark(keys[offset], text)
    return keys


def with_remark(keys: dict[str, Any], text: str) -> dict[str, Any]:
    """Return the keys of a scanned axis with a further remark."""
    before = keys.get("remark")
    return keys | {"remark": f"{before}; {text}" if before else text}


def clock_keys(devices: Sequence[EsiDevice]) -> dict[str, Any]:
    """Return ``clocks`` and ``sync0_shift_s`` where all of the drives agree."""
    if not devices or not all(device.clocks for device in devices):
        return {}
    modes = [_sync0_mode(device) for device in devices]
    if not any(modes):
        return {"clocks": "off"}
    shifts = {mode.shift_ns for mode in modes if mode}
    shift_ns = shifts.pop()
    return {} if shifts or not shift_ns else {"sync0_shift_s": shift_ns / 1e9}


def _has_velocity(device: EsiDevice, offsets: Sequence[int]) -> bool:
    held = _objects(device.pdos)
    return device.can_map or all(on_axis(TARGET_VELOCITY, offset) in held for offset in offsets)


def _sync0_mode(device: EsiDevice) -> Any:
    return next((mode for mode in device.clocks if mode.activate & _SYNC0), None)


def _objects(pdos: Iterable[EsiPdo]) -> set[int]:
    return {entry.index for pdo in pdos for entry in pdo.entries if entry.sub == 0}


def _chosen(pdos: Sequence[EsiPdo], needed: Sequence[int], taken: Sequence[EsiPdo]) -> list[EsiPdo]:
    """Return the first PDO that holds all objects, else as many as it takes.

    PDOs that exclude each other, or one that is taken, are not combined. Without a combination
    that holds all objects it is one that holds some.
    """
    helpful = [pdo for pdo in pdos if _objects([pdo]) & set(needed) and _combine(pdo, taken)]
    tried = [_filled(first, helpful, needed) for first in helpful[:_MAX_TRIED]]
    tried.sort(key=lambda found: (-len(_objects(found) & set(needed)), len(found)))
    return tried[0] if tried else []


def _filled(first: EsiPdo, pdos: Iterable[EsiPdo], needed: Sequence[int]) -> list[EsiPdo]:
    """Return ``first`` and PDOs with the objects that it lacks."""
    found = [first]
    for pdo in pdos:
        if (set(needed) - _objects(found)) & _objects([pdo]) and _combine(pdo, found):
            found.append(pdo)
    return found


def _combine(pdo: EsiPdo, others: Iterable[EsiPdo]) -> bool:
    """Return whether ``pdo`` can be assigned together with ``others``."""
    return not any(
        other.index != pdo.index and (other.index in pdo.excluded or pdo.index in other.excluded)
        for other in others
    )


def _writable(device: EsiDevice, pdos: Sequence[EsiPdo], taken: Sequence[EsiPdo]) -> EsiPdo | None:
    """Return a PDO whose contents can be written; None where there is none."""
    free = (pdo for pdo in pdos if not pdo.is_fixed and pdo not in taken)
    allowed = device.can_map and device.can_assign  # both are written
    return next((pdo for pdo in free if _combine(pdo, taken)), None) if allowed else None


def _written(device: EsiDevice, pdo: EsiPdo, needed: list[int], offset: int) -> dict[str, Any]:
    """Return ``pdo`` with the needed objects, and those useful ones that the device has."""
    useful = _USEFUL_INPUTS if pdo.assignment is Assignment.INPUTS else ()
    known = [on_axis(base, offset) for base in useful if (on_axis(base, offset), 0) in device.names]
    return {
        "index": f"0x{pdo.index:04X}",
        "objects": [f"0x{index:04X}" for index in (*needed, *known)],
    }
