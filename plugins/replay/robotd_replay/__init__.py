"""Replay backend: a recording as a robot whose axes cannot be commanded."""

from __future__ import annotations

from robotd.api import (
    AxisDriver,
    BackendInfo,
    Capability,
    DeviceContext,
    DeviceDriver,
    IoDriver,
    hookimpl,
)
from robotd_replay.device import ReplayAxes, ReplayDevice, Replayed, ReplayIo, ReplayOptions


@hookimpl
def robotd_backend() -> BackendInfo:
    """Describe the backend: it moves nothing and takes no commands."""
    return BackendInfo(
        summary="a recording, played as a robot with read-only axes",
        api_version=1,
        capabilities=frozenset({Capability.SIMULATED}),
        options=ReplayOptions,
    )


@hookimpl
def robotd_open_device(context: DeviceContext[Replayed]) -> DeviceDriver:
    """Make the device; the recording begins with the communication."""
    return ReplayDevice(context.options, context.clock)


@hookimpl
def robotd_axes(device: ReplayDevice) -> AxisDriver:
    """The recorded axes."""
    return ReplayAxes(device)


@hookimpl
def robotd_io(device: ReplayDevice) -> IoDriver:
    """The recorded inputs and outputs."""
    return ReplayIo(device)
