"""A descriptor with CANopen drives, made in Python."""

from __future__ import annotations

from typing import Any

from robotd.descriptor import RobotDescriptor
from robotd_canopen.layout import NetworkLayout, plan_network
from robotd_canopen.options import CanopenOptions


def drive(axis: int, **keys: Any) -> dict[str, Any]:
    return {"axis": axis, "node": axis + 1, "counts_per_rad": 1000.0, **keys}


def options(**keys: Any) -> CanopenOptions:
    keys["bus"] = {"interface": "virtual", **keys.get("bus", {})}
    section = {"axes": [drive(0), drive(1)], **keys}
    return CanopenOptions.model_validate(section)


def plan(section: CanopenOptions, axes: int = 2, rate_hz: float = 250.0) -> NetworkLayout:
    robot = RobotDescriptor.model_validate(
        {"schema": 1, "name": "test", "axes": axes, "cycle": {"rate_hz": rate_hz}}
    )
    return plan_network(robot, section)
