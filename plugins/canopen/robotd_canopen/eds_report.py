"""Report of what robotd does with an EDS or DCF file, for ``robotd canopen eds``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from canopen.objectdictionary import ObjectDictionary

from robotd.api import DescriptorError, RobotDescriptor
from robotd_canopen.default_pdos import LOST
from robotd_canopen.layout import NO_HEARTBEAT, AxisLayout, plan_network
from robotd_canopen.object_dictionary import DcfValue, dcf_values, describe, read_eds, variable
from robotd_canopen.options import CanopenOptions
from robotd_canopen.pdo import Pdo
from robotd_cia402.drive_setup import missing_mode
from robotd_cia402.modes import OperationMode
from robotd_cia402.options import STARTUP_WRITES, SetpointMode, VelocityMode

_DRIVE = 402
_SUPPORTED_MODES, _HEARTBEAT = 0x6502, 0x1017
_FALLING = (0x1016, 0x6007)  # without which a drive need not stop when its connection is lost
_IO = {0x6000: "input_length", 0x6200: "output_length"}


def eds_report(
    path: Path,
    node: int,
    stream_mode: SetpointMode = SetpointMode.CSP,
    velocity_mode: VelocityMode = VelocityMode.PV,
) -> Iterator[str]:
    """Yield lines about the file.

    Raises DescriptorError where the start refuses a drive that is as the file says.
    """
    dictionary = read_eds(path, node)
    values = dcf_values(dictionary)
    yield from _device(path, dictionary, is_dcf=bool(values))
    profile = _default(dictionary, 0x1000) & 0xFFFF
    lacks: list[str] = []
    if profile == _DRIVE or (not profile and 0x6040 in dictionary):
        yield _modes(dictionary)
        modes = {"stream_mode": stream_mode, "velocity_mode": velocity_mode}
        heartbeat = variable(dictionary, _HEARTBEAT, 0) is not None
        axis = _planned(path, {**modes, "eds": path.absolute(), "heartbeat": heartbeat}, node)
        yield from _drive(axis, dictionary)
        lacks = [missing_mode(_default(dictionary, _SUPPORTED_MODES), axis.options)]
        lacks += [] if heartbeat else [NO_HEARTBEAT]
    else:
        yield from _module(dictionary, profile)
    yield from _values(values)
    if reasons := "; ".join(filter(None, lacks)):
        what = f"the start refuses a drive that is as this file: {reasons}"
        raise DescriptorError(what, path=path)


def _device(path: Path, dictionary: ObjectDictionary, *, is_dcf: bool) -> Iterator[str]:
    device = dictionary.device_information
    name = " ".join(filter(None, (device.vendor_name, device.product_name))) or "unnamed"
    kind = "DCF" if is_dcf else "EDS"
    yield f"{path}: {kind} of {name}, {len(dictionary.indices)} objects"
    numbers = {
        "vendor_id": device.vendor_number,
        "product_code": device.product_number,
        "revision": device.revision_number,
    }
    parts = [f"{key}: 0x{number:X}" for key, number in numbers.items() if number]
    if parts:
        yield f"identity: {{{', '.join(parts)}}}"
    if rates := sorted(device.allowed_baudrates):
        yield f"bit rates: {', '.join(f'{rate // 1000}' for rate in rates)} kbit/s"
    if is_dcf and dictionary.node_id:
        yield f"made for node {dictionary.node_id}"


def _modes(dictionary: ObjectDictionary) -> str:
    supported = _default(dictionary, _SUPPORTED_MODES)
    names = [mode.name.lower() for mode in OperationMode if mode and supported & mode.support_bit]
    stated = ", ".join(names) or "not stated"
    return f"modes (0x6502): {stated}; those of the drive are read at start"


def _planned(path: Path, axis: dict[str, Any], node: int) -> AxisLayout:
    """Return the layout of an axis with this file. Raises DescriptorError."""
    robot = RobotDescriptor.model_validate({"schema": 1, "name": "eds", "axes": 1})
    section = {
        "bus": {"interface": "virtual"},
        "axes": [{"axis": 0, "node": node, "counts_per_rad": 1.0, **axis}],
        "max_bus_load": 1.0,
        "sync_period_s": 0.1,
    }
    try:
        return plan_network(robot, CanopenOptions.model_validate(section)).axes[0]
    except DescriptorError as error:
        text = str(error).replace("backends.canopen.axes.0: ", "")
        what = f"a drive with it needs rpdos and tpdos of its own, or cannot be used:\n{text}"
        raise DescriptorError(what, path=path) from None


def _drive(axis: AxisLayout, dictionary: ObjectDictionary) -> Iterator[str]:
    for pdo in (*axis.rpdos, *axis.tpdos):
        yield _pdo(pdo, dictionary)
    for base in axis.left_out:
        yield f"not in the PDOs: {describe(dictionary, base, 0)}: {LOST[base]}"
    written = [index for index in STARTUP_WRITES if _is_writable(dictionary, index)]
    heartbeat = [_HEARTBEAT] if axis.options.heartbeat else []
    yield f"written at start: {_hexadecimal([*heartbeat, *written]) or 'nothing'}"
    if missing := [index for index in STARTUP_WRITES if index not in written]:
        yield f"not written, missing or read-only: {_hexadecimal(missing)}"
    if unsafe := [index for index in _FALLING if index in missing]:
        text = "the drive need not stop by itself when robotd or the cable is lost"
        yield f"{_hexadecimal(unsafe)}: {text}"


def _pdo(pdo: Pdo, dictionary: ObjectDictionary) -> str:
    sent = f"on events ({pdo.transmission})" if pdo.is_event_driven else "each SYNC"
    if pdo.transmission > 1 and not pdo.is_event_driven:
        sent = f"each {pdo.transmission} SYNC"
    objects = ", ".join(describe(dictionary, entry.index, entry.sub) for entry in pdo.entries)
    return f"{pdo.name}, COB-ID 0x{pdo.cob_id:03X}, {sent}: {objects}"


def _module(dictionary: ObjectDictionary, profile: int) -> Iterator[str]:
    for index, key in _IO.items():
        count = _default(dictionary, index)
        if index in dictionary:
            yield f"{describe(dictionary, index, 1)}: {key}: {min(count, 8)}"
    if not any(index in dictionary for index in _IO):
        what = f"device type 0x1000 is CiA {profile}, that of a drive is CiA {_DRIVE}"
        yield f"neither a drive nor a module with digital I/O (0x6000, 0x6200): {what}"


def _values(values: list[DcfValue]) -> Iterator[str]:
    if not values:
        return
    written = [value for value in values if not value.skipped]
    yield f"dcf_values: true writes {len(written)} of {len(values)} values where the node's differ"
    for value in values:
        yield f"  {value.name} = {value.text}{f': {value.skipped}' if value.skipped else ''}"


def _default(dictionary: ObjectDictionary, index: int) -> int:
    found = variable(dictionary, index, 0)
    number = found.default if found is not None else None
    return number if isinstance(number, int) else 0


def _is_writable(dictionary: ObjectDictionary, index: int) -> bool:
    record = index in (0x1016, 0x60C2)
    found = variable(dictionary, index, 1 if record else 0)
    return found is not None and found.writable


def _hexadecimal(indexes: list[int]) -> str:
    return ", ".join(f"0x{index:04X}" for index in indexes)
