"""Hooks that are the same for every fieldbus with CiA 402 drives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robotd.api import (
    AxisDriver,
    AxisKeys,
    BackendInfo,
    BackendOptions,
    Capability,
    FieldbusDriver,
    IoDriver,
    hookimpl,
)
from robotd_cia402.drive_scan import stated_scales

if TYPE_CHECKING:
    from robotd_cia402.device import Cia402Device

_CAPABILITIES = frozenset(
    {
        Capability.VELOCITY_MODE,
        Capability.TORQUE_MODE,
        Capability.HAND_GUIDING,  # where axes have a damping for it
        Capability.HOMING,
        Capability.SCALING,
        Capability.STATISTICS,
        Capability.OBJECTS,
        Capability.DEVICE_WATCHDOG,
    }
)


def backend_info(
    summary: str, section: type[BackendOptions], node_key: str, *more: Capability
) -> BackendInfo:
    """Describe a backend: no parameter files.

    Args:
        node_key: key of an axis that names its node.
        more: capabilities beyond those of every such backend.
    """
    return BackendInfo(
        summary=summary,
        api_version=1,
        capabilities=_CAPABILITIES.union(more),
        options=section,
        axis_keys=AxisKeys(
            items="axes",
            scale="counts_per_rad",
            polarity="polarity",
            node=node_key,
            identity="identity",
            window_object="0x6065",
            stated_scales=lambda read, item: stated_scales(read, item["axis_offset"]),
        ),
    )


@hookimpl
def robotd_axes(device: Cia402Device[Any, Any]) -> AxisDriver:
    """One axis for each entry of ``axes``."""
    axes: AxisDriver = device.master
    return axes


@hookimpl
def robotd_io(device: Cia402Device[Any, Any]) -> IoDriver | None:
    """None without modules."""
    io: IoDriver = device.master.io
    return io if device.master.io.modules else None


@hookimpl
def robotd_fieldbus(device: Cia402Device[Any, Any]) -> FieldbusDriver:
    """One master."""
    return device.fieldbus
