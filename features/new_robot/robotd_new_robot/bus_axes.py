"""Scanned drives as the backend section of a new robot."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from robotd.api import DescriptorError
from robotd.api.models import MAX_AXES, UrdfJoint, read_limited

MAX_BYTES = 1_000_000
DRIVE_NUMBERS = ("node", "slave", "servo")  # keys of a scanned axis that name its drive
HALF_TURN_RAD = 3.14
SLOW_RAD_S = 0.2


class BusScan(BaseModel):
    """Result of a bus scan, such as ``robotd canopen scan --json``; further keys are ignored.

    Attributes:
        backend: name of the backend.
        scale: key of the encoder scale in each item of ``axes``; None: the backend keeps neither
            drives nor scale in the descriptor, and finds its drives in the order of the bus.
        options: keys of its section besides axes and I/O.
        axes: keys of each drive, in the order of the bus; ``remark`` becomes a comment.
        io: I/O modules.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", strict=True)

    backend: str
    scale: str | None = None
    options: dict[str, Any]
    axes: list[dict[str, Any]]
    io: list[dict[str, Any]] = []


def read_bus_scan(path: Path) -> BusScan:
    """Read a file. Raises DescriptorError."""
    try:
        return BusScan.model_validate(json.loads(read_limited(path, MAX_BYTES)))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or None
        raise DescriptorError(f"is not a bus scan: {first['msg']}", path=path, key=key) from None
    except ValueError as error:  # JSON, or not UTF-8
        raise DescriptorError(f"is not a bus scan: {error}", path=path) from None


def bus_joints(scan: BusScan, path: Path) -> tuple[UrdfJoint, ...]:
    """Return a joint for each drive, called as the drive: ``node3``, or ``slave0``.

    The second axis of a drive is ``node3_2``. Nothing else is known: they turn, slowly.
    Raises DescriptorError: no drive, or more than a robot may have.
    """
    if not 1 <= len(scan.axes) <= MAX_AXES:
        what = f"has {len(scan.axes)} drives, a robot has 1 to {MAX_AXES}"
        raise DescriptorError(what, path=path, key="axes")
    names: list[str] = []
    for number, axis in enumerate(scan.axes):
        known = (f"{key}{axis[key]}" for key in DRIVE_NUMBERS if key in axis)
        name = next(known, f"joint{number + 1}")
        count = 1 + sum(other.split("_")[0] == name for other in names)
        names.append(name if count == 1 else f"{name}_{count}")
    return tuple(map(_unknown_joint, names))


def _unknown_joint(name: str) -> UrdfJoint:
    return UrdfJoint(
        name, 0, "revolute", "base", name, np.eye(4), np.array([0.0, 0.0, 1.0]),
        lower=-HALF_TURN_RAD, upper=HALF_TURN_RAD, velocity=SLOW_RAD_S, effort=None, soft=None,
        mimic=None,
    )  # fmt: skip


def bus_options(scan: BusScan) -> Iterator[str]:
    """Yield the lines that give a robot the backend of a scan, and its options."""
    yield f"backend: {scan.backend}"
    yield "backends:"
    yield f"  {scan.backend}: {_flow(scan.options)}"


def bus_section(scan: BusScan, joints: Sequence[UrdfJoint], path: Path) -> Iterator[str]:
    """Yield the lines below ``backends`` that give each joint its drive, in their order.

    The scale of a prismatic joint depends on its spindle and is left out, so that ``robotd check``
    asks for it. Raises DescriptorError: fewer drives than joints.
    """
    if len(scan.axes) < len(joints):
        what = f"has {len(scan.axes)} drives, the robot has {len(joints)} axes"
        raise DescriptorError(what, path=path, key="axes")
    if scan.scale is None:
        yield from _remarks(scan, joints, path)
        return
    yield f"  {scan.backend}:                              # scanned: {path.name}"
    for key, value in scan.options.items():
        yield f"    {key}: {_flow(value)}"
    yield "    # In the order of the bus: exchange the nodes if a joint has another drive."
    if any(scan.scale not in axis for axis in scan.axes):
        yield f"    # Add polarity, and {scan.scale} where the drive does not state it."
    yield "    axes:"
    for number, (joint, axis) in enumerate(zip(joints, scan.axes, strict=False)):
        keys = {"axis": number, **axis}
        remark = keys.pop("remark", "")
        note = f"{joint.name}; {remark}" if remark else joint.name
        if joint.type == "prismatic":
            keys.pop(scan.scale, None)
            note += f", add {scan.scale}: counts per m"
        yield f"      - {_flow(keys)}    # {note}"
    for axis in scan.axes[len(joints) :]:
        yield f"      # no joint: {_flow(axis)}"
    if scan.io:
        yield "    io:"
        for module in scan.io:
            yield f"      - {_flow(module)}"


def _remarks(scan: BusScan, joints: Sequence[UrdfJoint], path: Path) -> Iterator[str]:
    """Yield the section of a backend that finds its drives by itself, with remarks."""
    yield f"  # Scanned: {path.name}. Axes count in the order of the bus; their scale is in the"
    yield "  # backend's own files (parameters_file)."
    for number, axis in enumerate(scan.axes):
        name = joints[number].name if number < len(joints) else "no joint"
        yield f"  # axis {number}, {name}: {_flow(axis)}"
    yield f"  {scan.backend}: {_flow(scan.options)}"


def _flow(value: Mapping[str, Any] | Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, sort_keys=False, width=10_000)
    return text.removesuffix("\n").removesuffix("\n...")
