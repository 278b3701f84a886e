"""Model of the descriptor section ``backends.canopen``; every key ends in its unit.

The descriptions below are the reference. Node ids, object numbers, their values, parts of an
identity and COB-IDs may be written in hexadecimal.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, field_validator

from robotd_cia402.options import (
    BackendSection,
    DriveOptions,
    FieldbusOptions,
    Identity,
    Integer,
    ModuleOptions,
    ObjectName,
    Positive,
    SdoWrite,
    StartupWrite,
)

NodeId = Annotated[Integer, Field(ge=1, le=127)]
_UNUSED_TYPES = range(241, 254)  # transmission types: reserved, or on remote request (CiA 301)
QUEUELESS = frozenset(("virtual", "udp_multicast"))
"""Interfaces of python-can whose frames wait for nothing."""
DISCARDING = frozenset(("kvaser", "vector", "ixxat", "systec", "etas", "canalystii"))
"""Interfaces whose adapters discard unsent frames."""
_ECHOING = frozenset(("udp_multicast", "gs_usb"))
PDO_COB_IDS = frozenset((*range(0x181, 0x580), *range(0x680, 0x6E0)))
"""Those of no other service (CiA 301, 7.3.3)."""


def _for_pdo(cob_id: int) -> int:
    if cob_id not in PDO_COB_IDS:
        allowed = "0x181 to 0x57F and 0x680 to 0x6DF"
        raise ValueError(f"0x{cob_id:03X} is not for PDOs: {allowed} are")
    return cob_id


CobId = Annotated[Integer, AfterValidator(_for_pdo)]


class BusOptions(BackendSection):
    """CAN bus, in the terms of python-can."""

    interface: str = Field("socketcan", description="Interface of python-can.")
    channel: str | int | None = Field(
        None, description="Channel of that interface; required, except for `virtual`."
    )
    bitrate: int = Field(1_000_000, ge=10_000, le=1_000_000, description="Bits per second.")
    options: dict[str, Any] = Field({}, description="Further arguments of `can.Bus`.")

    @property
    def echoes(self) -> bool:
        """The interface returns the frames that it sends."""
        return self.interface in _ECHOING or bool(self.options.get("receive_own_messages"))


class PdoOptions(BackendSection):
    """One PDO: when it travels and what it holds."""

    number: int = Field(ge=1, le=512, description="Number of the PDO in the node, from 1.")
    cob_id: CobId | None = Field(
        None, description="COB-ID; null takes the predefined one of PDO 1 to 4."
    )
    transmission: int = Field(
        1, ge=1, le=255, description="1 to 240: each n-th SYNC; 254, 255: on an event."
    )
    objects: tuple[ObjectName, ...] = Field(
        min_length=1, max_length=8, description="Objects in order, `0x6041` or `0x60C1:1`."
    )

    @field_validator("transmission")
    @classmethod
    def _is_used(cls, value: int) -> int:
        if value in _UNUSED_TYPES:
            raise ValueError(
                f"{value} is reserved, or waits for a remote request that robotd does not send;"
                " 1 to 240 go with SYNC, 254 and 255 on an event"
            )
        return value


class NodeOptions(BackendSection):
    """Options common to drives and I/O modules."""

    node: NodeId = Field(description="Node id.")
    eds: Path | None = Field(None, description="EDS file, relative to the robot's; null: generic.")
    identity: Identity = Field(Identity(), description="Identity that the node must have.")
    dcf_values: bool = Field(
        False,
        description="Write the values (`ParameterValue`) of the file `eds`, a DCF, at start where"
        " those of the node differ.",
    )
    startup: tuple[SdoWrite, ...] = Field((), description="Objects written at start, in order.")
    skip_writes: tuple[StartupWrite, ...] = Field(
        (), description="Objects that are not written at start, such as `0x1016`."
    )


class AxisOptions(DriveOptions, NodeOptions):
    """One axis of a drive."""

    heartbeat: bool = Field(
        True,
        description="The drive sends heartbeats; false: it has no object 0x1017, and is supervised"
        " by its PDOs alone.",
    )
    rpdos: tuple[PdoOptions, ...] = Field((), description="PDOs to the drive; empty: the default.")
    tpdos: tuple[PdoOptions, ...] = Field((), description="PDOs of the drive; empty: the default.")


class IoOptions(ModuleOptions, NodeOptions):
    """One I/O module, and the bytes of the robot's I/O image that it serves."""

    input_length: int = Field(0, ge=0, le=8, description="Bytes of inputs (object 0x6000).")
    output_length: int = Field(0, ge=0, le=8, description="Bytes of outputs (object 0x6200).")


class CanopenOptions(FieldbusOptions):
    """The section ``backends.canopen``."""

    bus: BusOptions = Field(BusOptions(), description="The CAN bus.")
    simulated: bool = Field(
        False, description="Simulate the nodes in this process; for the interface virtual."
    )
    sync_period_s: Positive | None = Field(
        None, le=1, description="SYNC period, a whole number of cycles; null: each cycle."
    )
    master_node: NodeId = Field(127, description="Node id whose heartbeat is ours.")
    heartbeat_s: float = Field(0.1, ge=0.01, le=10, description="Heartbeat of all nodes.")
    heartbeat_timeout_s: Positive = Field(
        0.5,
        le=65.535,
        description="Silence after which a node is lost, and after which it loses us.",
    )
    sdo_timeout_s: Positive = Field(0.3, description="Time for one answer.")
    sdo_tries: int = Field(
        3, ge=1, le=10, description="Requests before a silent node is given up; an abort is final."
    )
    stream_timeout_s: Positive = Field(
        0.1, description="Without a new setpoint for this long, streaming axes stop by themselves."
    )
    max_bus_load: float = Field(0.9, gt=0, le=1, description="Highest computed load of the bus.")
    allow_partial: bool = Field(
        False, description="Start although drives fail; their axes are offline."
    )
    axes: tuple[AxisOptions, ...] = Field((), description="The axes, each with its drive.")
    axis_defaults: dict[str, Any] = Field({}, description="Keys that all axes have in common.")
    io: tuple[IoOptions, ...] = Field((), description="The I/O modules.")

    def problems(self, nodes: Collection[int]) -> Iterator[str]:
        if self.master_node in nodes:
            yield f"node {self.master_node} is the master's own"
        apart_s = self.heartbeat_s + (self.sync_period_s or 0.0)
        if (timeout_s := self.heartbeat_timeout_s) <= apart_s:
            yield (
                f"heartbeat_timeout_s: {timeout_s:g} s is not above heartbeat_s and sync_period_s"
                f" together, {apart_s:g} s"
            )
