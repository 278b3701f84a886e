"""Model of the descriptor section ``backends.canopen``; every key ends in its unit.

The descriptions below are the reference. Node ids, object numbers and COB-IDs may be written
in hexadecimal.
"""

from __future__ import annotations

from collections import Counter
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from robotd.api import BackendOptions

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NodeId = Annotated[int, Field(ge=1, le=127)]
ObjectName = Annotated[str, StringConstraints(pattern=r"^0x[0-9A-Fa-f]{4}(:[0-9]{1,3})?$")]
CobId = Annotated[int, Field(ge=0x001, le=0x7FF)]


class Section(BaseModel):
    """Base of the sections: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class BusOptions(Section):
    """CAN bus, in the terms of python-can."""

    interface: str = Field("socketcan", description="Interface of python-can.")
    channel: str | int = Field("can0", description="Channel of that interface.")
    bitrate: int = Field(1_000_000, ge=10_000, le=1_000_000, description="Bits per second.")
    options: dict[str, Any] = Field({}, description="Further arguments of `can.Bus`.")


class StreamMode(StrEnum):
    """Mode of operation for trajectories."""

    CSP = "csp"  # cyclic synchronous position
    IP = "ip"  # interpolated position, for drives that have only that


class VelocityMode(StrEnum):
    """Mode of operation for velocity commands."""

    PV = "pv"  # profile velocity: the drive makes the ramps
    CSV = "csv"  # cyclic synchronous velocity: the ramps are sent with each SYNC


class PdoOptions(Section):
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


class SdoWrite(Section):
    """One object that is written while the node starts."""

    object: ObjectName = Field(description="Object, `0x6085` or `0x607D:1`.")
    value: int = Field(description="Value in the object's own unit.")


class Identity(Section):
    """Expected object 0x1018; null is not compared."""

    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None


class NodeOptions(Section):
    """Options common to drives and I/O modules."""

    node: NodeId = Field(description="Node id.")
    eds: Path | None = Field(None, description="EDS file, relative to the robot's; null: generic.")
    identity: Identity = Field(Identity(), description="Identity that the node must have.")
    startup: tuple[SdoWrite, ...] = Field((), description="Objects written at start, in order.")


class SimulatedSwitches(Section):
    """Switches of a simulated axis, rad (or m) of the joint from power-on; null: none."""

    negative_limit_rad: float | None = Field(None, description="Closed here and below.")
    positive_limit_rad: float | None = Field(None, description="Closed here and above.")
    home_rad: float | None = Field(None, description="Middle of the home switch.")
    home_width_rad: Positive = Field(0.02, description="Width of the home switch.")


class AxisOptions(NodeOptions):
    """One axis of a drive."""

    axis: int = Field(ge=0, description="Axis of the robot.")
    axis_offset: int = Field(
        0, ge=0, le=7, description="Axis within a multi-axis drive: objects are moved by 0x800."
    )
    counts_per_rad: Positive = Field(description="Encoder counts per rad (or m) of the joint.")
    polarity: int = Field(1, description="1 or -1: which way the drive counts.")
    velocity_per_rad_s: Positive | None = Field(
        None, description="Drive's velocity units per rad/s; null: counts per second."
    )
    acceleration_per_rad_s2: Positive | None = Field(
        None, description="Drive's acceleration units per rad/s²; null: counts per second²."
    )
    stream_mode: StreamMode = Field(StreamMode.CSP, description="Mode of trajectories.")
    velocity_mode: VelocityMode = Field(VelocityMode.PV, description="Mode of velocity commands.")
    homing_method: int = Field(
        37, ge=-128, le=37, description="35 and 37 take the present position, others move."
    )
    homing_speed_rad_s: Positive = Field(0.1, description="Speed towards the switch.")
    homing_creep_rad_s: Positive = Field(0.02, description="Speed towards the edge.")
    homing_acceleration_rad_s2: Positive = Field(1.0, description="Ramp of homing.")
    stop_deceleration_rad_s2: Positive = Field(
        10.0, description="Ramp of a controlled stop that no command gave one."
    )
    quick_stop_deceleration_rad_s2: Positive = Field(40.0, description="Ramp of a quick stop.")
    simulated_switches: SimulatedSwitches = Field(
        SimulatedSwitches(), description="Switches of the simulated axis."
    )
    rpdos: tuple[PdoOptions, ...] = Field((), description="PDOs to the drive; empty: the default.")
    tpdos: tuple[PdoOptions, ...] = Field((), description="PDOs of the drive; empty: the default.")

    @model_validator(mode="after")
    def _polarity(self) -> Self:
        if self.polarity not in (1, -1):
            raise ValueError(f"polarity {self.polarity} is not 1 or -1")
        return self


class IoOptions(NodeOptions):
    """One I/O module, and the bytes of the robot's I/O image that it serves."""

    input_byte: int = Field(0, ge=0, lt=8000, description="First byte of the input image.")
    input_length: int = Field(0, ge=0, le=8, description="Bytes of inputs (object 0x6000).")
    output_byte: int = Field(0, ge=0, lt=8000, description="First byte of the output image.")
    output_length: int = Field(0, ge=0, le=8, description="Bytes of outputs (object 0x6200).")


class CanopenOptions(BackendOptions):
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
        0.5, description="Silence after which a node is lost, and after which it loses us."
    )
    sdo_timeout_s: Positive = Field(0.3, description="Time for one answer.")
    sdo_tries: int = Field(3, ge=1, le=10, description="Attempts before a node is given up.")
    stream_timeout_s: Positive = Field(
        0.1, description="Without a new setpoint for this long, streaming axes stop by themselves."
    )
    max_bus_load: float = Field(0.9, gt=0, le=1, description="Highest computed load of the bus.")
    allow_partial: bool = Field(
        False, description="Start although nodes fail; their axes are offline."
    )
    axes: tuple[AxisOptions, ...] = Field((), description="The axes, each with its drive.")
    axis_defaults: dict[str, Any] = Field({}, description="Keys that all axes have in common.")
    io: tuple[IoOptions, ...] = Field((), description="The I/O modules.")

    @model_validator(mode="before")
    @classmethod
    def _with_defaults(cls, data: Any) -> Any:
        """Lay each axis over ``axis_defaults``."""
        if not isinstance(data, dict):
            return data
        defaults, axes = data.get("axis_defaults"), data.get("axes")
        if not isinstance(defaults, dict) or not isinstance(axes, list | tuple):
            return data
        merged = [{**defaults, **axis} if isinstance(axis, dict) else axis for axis in axes]
        return {**data, "axes": merged}

    @model_validator(mode="after")
    def _unique(self) -> Self:
        """Each axis and each part of a node once."""
        problems = [f"axis {axis} is given twice" for axis in _twice(a.axis for a in self.axes)]
        drives = {(a.node, a.axis_offset) for a in self.axes}
        if len(drives) < len(self.axes):
            doubled = _twice((a.node, a.axis_offset) for a in self.axes)
            problems += [f"node {n} is given twice with axis_offset {o}" for n, o in doubled]
        modules = [module.node for module in self.io]
        taken = {node for node, _ in drives} | {self.master_node}
        problems += [f"node {node} is given twice" for node in _twice(modules)]
        problems += [f"node {node} is given twice" for node in modules if node in taken]
        if self.master_node in {node for node, _ in drives}:
            problems.append(f"node {self.master_node} is the master's own")
        if problems:
            raise ValueError("; ".join(dict.fromkeys(problems)))
        return self


def _twice(values: Any) -> list[Any]:
    return [value for value, count in Counter(values).items() if count > 1]


def parse_object(name: str) -> tuple[int, int]:
    """Parse ``0x60C1:1`` to (0x60C1, 1); without a subindex it is 0."""
    index, _, sub = name.partition(":")
    return int(index, 16), int(sub or 0)
