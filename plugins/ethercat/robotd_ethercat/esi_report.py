"""Lines about a device of an ESI, for ``robotd ethercat esi`` and ``scan --esi``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from robotd_ethercat.esi_choice import axis_offsets, clock_keys, pdo_keys
from robotd_ethercat.esi_device import EsiDevice, EsiPdo
from robotd_ethercat.mapping import Assignment

_DRIVE = 402


def device_line(device: EsiDevice) -> str:
    """``EL7211 (Beckhoff Automation), vendor 0x00000002, ...``."""
    maker = f" ({device.vendor_name})" if device.vendor_name else ""
    profiles = "".join(f", CiA {number}" for number in dict.fromkeys(device.profiles))
    return (
        f"{device.name}{maker}, vendor 0x{device.vendor:08X}, product 0x{device.product:08X},"
        f" revision 0x{device.revision:08X}{profiles}"
    )


def is_drive(device: EsiDevice) -> bool:
    """True for a device with a controlword in its PDOs, whatever profiles it states."""
    return bool(axis_offsets(device))


def detail_lines(device: EsiDevice) -> Iterator[str]:
    """Yield slots, PDOs, clock modes, and the choice of robotd for a drive."""
    names = {module.ident: module.name for module in device.modules}
    for number, slot in enumerate(device.slots):
        plugged = "empty"
        if slot.module is not None:
            unknown = f"module 0x{slot.module:X}, which is not in the ESI: its PDOs are unknown"
            plugged = names.get(slot.module, unknown)
        yield f"slot {number}{f' ({slot.name})' if slot.name else ''}: {plugged}"
    for pdo in device.pdos:
        yield from _pdo_lines(pdo)
    for clock in device.clocks:
        shift = f", SYNC0 shifted by {clock.shift_ns} ns" if clock.shift_ns else ""
        yield f"clock {clock.name or 'unnamed'}: AssignActivate 0x{clock.activate:04X}{shift}"
    if is_drive(device):
        for offset, keys in pdo_keys(device, pv=False).items():
            yield f"axis {offset}: {_chosen(keys)}"


def scan_lines(device: EsiDevice | None) -> Iterator[str]:
    """Yield lines below a scanned slave: its ESI, clock modes, and PDOs of the axes."""
    if device is None:
        yield "no ESI"
        return
    yield f"ESI {device.path.name}: {device_line(device)}"
    for line in detail_lines(device):
        if line.startswith(("slot", "clock", "axis")):
            yield line


def esi_sections(devices: Sequence[EsiDevice]) -> dict[str, Any]:
    """Return devices in the order of the cable as a scan, which 'new-robot --bus' reads."""
    axes, modules = [], []
    for slave, device in enumerate(devices):
        identity = {"vendor_id": device.vendor, "product_code": device.product}
        keys: dict[str, Any] = {"slave": slave, "identity": identity}
        if is_drive(device):
            for offset, own in pdo_keys(device, pv=False).items():
                axes.append(keys | ({"axis_offset": offset} if offset else {}) | own)
        elif any(sizes := _default_sizes(device)):
            modules.append(keys | {"output_length": sizes[0], "input_length": sizes[1]})
    drives = [device for device in devices if is_drive(device)]
    return {
        "backend": "ethercat",
        "scale": "counts_per_rad",
        "options": clock_keys(drives),
        "axes": axes,
        "io": modules,
    }


def _chosen(keys: dict[str, Any]) -> str:
    if not keys:
        return "the default assignment has what robotd needs"
    lists = [f"{key}: {value}" for key, value in keys.items() if key != "remark"]
    return "; ".join([*lists, *([keys["remark"]] if "remark" in keys else [])])


def _pdo_lines(pdo: EsiPdo) -> Iterator[str]:
    way = "RxPDO" if pdo.assignment is Assignment.OUTPUTS else "TxPDO"
    state = "assigned" if pdo.is_assigned else "not assigned"
    kind = "fixed" if pdo.is_fixed else "can be written"
    excluded = ", ".join(f"0x{index:04X}" for index in sorted(pdo.excluded))
    without = f", not with {excluded}" if excluded else ""
    yield f"{way} 0x{pdo.index:04X} {pdo.name} ({state}, {kind}{without})"
    for entry in pdo.entries:
        object_ = f"0x{entry.index:04X}:{entry.sub:02X}" if entry.index else "gap"
        yield f"  {object_} {entry.bits} bit {entry.name}".rstrip()


def _default_sizes(device: EsiDevice) -> tuple[int, int]:
    """Return the bytes of outputs and inputs of the default assignment."""
    bits = dict.fromkeys(Assignment, 0)
    for pdo in device.pdos:
        if pdo.is_assigned:
            bits[pdo.assignment] += sum(entry.bits for entry in pdo.entries)
    return (bits[Assignment.OUTPUTS] + 7) // 8, (bits[Assignment.INPUTS] + 7) // 8
