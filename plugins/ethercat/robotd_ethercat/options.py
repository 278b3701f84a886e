"""Model of the descriptor section ``backends.ethercat``; every key ends in its unit.

The descriptions below are the reference. Object numbers, their values, parts of an identity and
the alias may be written in hexadecimal.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from enum import StrEnum
from typing import Annotated, Any

from pydantic import Field

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
    VelocityMode,
)

MAX_SLAVES = 199  # of SOEM
MAX_IO_BYTES = 1486  # of a module, in each direction


PdoIndex = Annotated[Integer, Field(ge=0x1600, le=0x1BFF)]
Milliseconds = Annotated[float, Field(gt=0, le=6000, allow_inf_nan=False)]


class Clocks(StrEnum):
    """Use of distributed clocks."""

    OFF = "off"  # drives act on the arrival of the frame (SM event)
    SYNC0 = "sync0"  # drives act on SYNC0, one pulse in each period


class PdoOptions(BackendSection):
    """One PDO in the assignment 0x1C12 or 0x1C13."""

    index: PdoIndex = Field(description="Number of the PDO, `0x1600` or `0x1A00`.")
    objects: tuple[ObjectName, ...] = Field(
        (),
        max_length=32,
        description="Objects in order, `0x6041`; empty: the contents that the drive has.",
    )


class SlaveOptions(BackendSection):
    """Options common to drives and I/O modules."""

    slave: int = Field(ge=0, lt=MAX_SLAVES, description="Place on the cable, 0 is the first.")
    alias: Integer | None = Field(
        None, ge=1, le=0xFFFF, description="Station alias that it must have; null: not compared."
    )
    identity: Identity = Field(Identity(), description="Identity that the slave must have.")
    startup: tuple[SdoWrite, ...] = Field((), description="Objects written at start, in order.")
    complete_access: bool = Field(
        True,
        description="Read the mapping by complete access where the slave announces it; false: by"
        " plain SDO, also done after a failure, which a warning names.",
    )
    rx_pdos: tuple[PdoOptions, ...] = Field(
        (), description="Assignment 0x1C12, PDOs to the slave; empty: the slave's own."
    )
    tx_pdos: tuple[PdoOptions, ...] = Field(
        (), description="Assignment 0x1C13, PDOs of the slave; empty: the slave's own."
    )


class AxisOptions(DriveOptions, SlaveOptions):
    """One axis of a drive."""

    velocity_mode: VelocityMode = Field(VelocityMode.CSV, description="Mode of velocity commands.")


class IoOptions(ModuleOptions, SlaveOptions):
    """One I/O module, and the bytes of the robot's I/O image that it serves."""

    input_length: int = Field(0, ge=0, le=MAX_IO_BYTES, description="Bytes of inputs.")
    output_length: int = Field(0, ge=0, le=MAX_IO_BYTES, description="Bytes of outputs.")


class EthercatOptions(FieldbusOptions):
    """The section ``backends.ethercat``."""

    node_kind = "slave"

    interface: str | None = Field(
        None,
        min_length=1,
        description="Network interface of the bus; required, except with `simulated`.",
    )
    redundant_interface: str | None = Field(
        None,
        description="Interface at the other end of the cable, with `clocks: off`; null: none.",
    )
    simulated: bool = Field(
        False, description="Simulate the slaves behind a pair of virtual interfaces."
    )
    clocks: Clocks = Field(Clocks.SYNC0, description="Distributed clocks: `sync0` or `off`.")
    sync0_shift_s: float = Field(
        0.0, ge=-1, le=1, description="SYNC0 after the start of the period of the bus time."
    )
    max_lost_frames: int = Field(
        4, ge=1, le=100, description="Frames in a row, lost or incomplete, until all axes stop."
    )
    state_timeout_s: Positive = Field(5.0, description="Time for one change of AL state.")
    sdo_timeout_s: Positive = Field(0.7, description="Time for one SDO answer.")
    watchdog_ms: Milliseconds | None = Field(
        None, description="Process data watchdog of the slaves; null: their own, usually 100 ms."
    )
    stream_timeout_s: Positive = Field(
        0.1, description="Without a new setpoint for this long, streaming axes stop by themselves."
    )
    axes: tuple[AxisOptions, ...] = Field((), description="The axes, each with its drive.")
    axis_defaults: dict[str, Any] = Field({}, description="Keys that all axes have in common.")
    io: tuple[IoOptions, ...] = Field((), description="The I/O modules.")

    def problems(self, nodes: Collection[int]) -> Iterator[str]:
        if self.redundant_interface is not None and self.redundant_interface == self.interface:
            yield f"redundant_interface is {self.interface!r} as well"
        if self.redundant_interface is not None and self.clocks is not Clocks.OFF:
            yield (
                "redundant_interface needs clocks: off: behind a cut cable the time in the frame is"
                " up to a period old"
            )
