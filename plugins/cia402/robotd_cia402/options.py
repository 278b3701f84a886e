"""Options of one CiA 402 axis on any fieldbus; keys end in their unit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from enum import StrEnum
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    model_validator,
)

from robotd.api import BackendOptions, DescriptorError, RobotDescriptor


def _from_hexadecimal(value: object) -> object:
    """Read ``0x29C``, which a descriptor leaves a text."""
    return int(value, 16) if isinstance(value, str) and _HEXADECIMAL.fullmatch(value) else value


_HEXADECIMAL = re.compile(r"-?0[xX][0-9A-Fa-f]{1,8}")
Integer = Annotated[int, BeforeValidator(_from_hexadecimal)]
"""Whole number that may be written in hexadecimal."""
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
ObjectName = Annotated[str, StringConstraints(pattern=r"^0x[0-9A-Fa-f]{4}(:[0-9]{1,3})?$")]


STARTUP_WRITES = (0x1016, 0x6007, 0x605A, 0x605D, 0x6085, 0x60C2)
"""Objects that are written at start and that a drive can do without."""


def _one_of_startup_writes(index: int) -> int:
    if index not in STARTUP_WRITES:
        known = ", ".join(f"0x{index:04X}" for index in STARTUP_WRITES)
        raise ValueError(f"0x{index:04X} is not written at start; these are: {known}")
    return index


StartupWrite = Annotated[Integer, AfterValidator(_one_of_startup_writes)]


class BackendSection(BaseModel):
    """Base of the sections: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class SetpointMode(StrEnum):
    """Mode of operation for trajectories."""

    CSP = "csp"  # cyclic synchronous position
    IP = "ip"  # interpolated position, for drives that have only that


class VelocityMode(StrEnum):
    """Mode of operation for velocity commands."""

    PV = "pv"  # profile velocity: the drive makes the ramps
    CSV = "csv"  # cyclic synchronous velocity: the ramps are sent with each frame


class SdoWrite(BackendSection):
    """One object that is written while the node starts."""

    object: ObjectName = Field(description="Object, `0x6085` or `0x607D:1`.")
    value: Integer = Field(description="Value in the object's own unit.")


class Identity(BackendSection):
    """Expected object 0x1018; null is not compared."""

    vendor_id: Integer | None = None
    product_code: Integer | None = None
    revision: Integer | None = None
    serial: Integer | None = None


class SimulatedSwitches(BackendSection):
    """Switches of a simulated axis, rad (or m) of the joint from power-on; null: none."""

    negative_limit_rad: float | None = Field(None, description="Closed here and below.")
    positive_limit_rad: float | None = Field(None, description="Closed here and above.")
    home_rad: float | None = Field(None, description="Middle of the home switch.")
    home_width_rad: Positive = Field(0.02, description="Width of the home switch.")


class DriveOptions(BackendSection):
    """One axis of a drive: modes, scale, homing and ramps."""

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
    stream_mode: SetpointMode = Field(SetpointMode.CSP, description="Mode of trajectories.")
    velocity_mode: VelocityMode = Field(VelocityMode.PV, description="Mode of velocity commands.")
    homing_method: int = Field(
        37,
        ge=-128,
        le=37,
        description="35 and 37 take the present position; all others move, at the speed in force.",
    )
    homing_speed_rad_s: Positive = Field(0.1, description="Speed towards the switch.")
    homing_creep_rad_s: Positive = Field(0.02, description="Speed towards the edge.")
    homing_acceleration_rad_s2: Positive = Field(1.0, description="Ramp of homing.")
    stop_deceleration_rad_s2: Positive = Field(
        10.0,
        description="Ramp of a controlled stop that no command gave one. Not given: that of the"
        " joint, the wheel or the steering in the robot's file.",
    )
    quick_stop_deceleration_rad_s2: Positive = Field(40.0, description="Ramp of a quick stop.")
    guiding_damping_nm_s_rad: float | None = Field(
        None,
        ge=0,
        allow_inf_nan=False,
        description="Hand guiding by torque: N·m per rad/s (or N per m/s) that a hand has to"
        " overcome. Given only where the masses of the URDF are those of the arm, tool included:"
        " they carry it. null: the axis is not guided.",
    )
    brake_release_s: float = Field(
        0.0,
        ge=0,
        le=10,
        description="Time that the brake needs after the drive reports *operation enabled*, where"
        " the drive ignores setpoints meanwhile: switching on ends, and motions begin, after it."
        " Less than `engine.servo_timeout_s`. 0: as long as the drive shows by bit 12.",
    )
    hanging_load: bool = Field(
        False,
        description="The axis falls without torque until its brake holds: after a quick stop the"
        " servo goes off by way of *operation enabled*, at rest, so that the drive closes the brake"
        " first.",
    )
    check_modes: bool = Field(
        True,
        description="Require the modes in object 0x6502; false: for a drive without it, or with 0.",
    )
    skip_writes: tuple[StartupWrite, ...] = Field(
        (), description="Objects that are not written at start, such as `0x605A`."
    )
    simulated_position_rad: float | None = Field(
        None,
        allow_inf_nan=False,
        description="Position of the simulated axis at power-on, in m if prismatic; null: 0, or the"
        " nearest one inside the limits of the joint.",
    )
    simulated_switches: SimulatedSwitches = Field(
        SimulatedSwitches(), description="Switches of the simulated axis."
    )

    @model_validator(mode="after")
    def _polarity(self) -> Self:
        if self.polarity not in (1, -1):
            raise ValueError(f"polarity {self.polarity} is not 1 or -1")
        return self


class ModuleOptions(BackendSection):
    """Bytes of the robot's I/O image that one I/O module serves."""

    input_byte: int = Field(0, ge=0, lt=8000, description="First byte of the input image.")
    input_length: int = Field(0, ge=0, description="Bytes of inputs.")
    output_byte: int = Field(0, ge=0, lt=8000, description="First byte of the output image.")
    output_length: int = Field(0, ge=0, description="Bytes of outputs.")


Drive = TypeVar("Drive", bound=DriveOptions)


class FieldbusOptions(BackendOptions):
    """Base of a fieldbus' section: ``axes`` lie over ``axis_defaults``, and nothing is given twice.

    A subclass has these keys, and ``io``.
    """

    node_kind: ClassVar[str] = "node"
    """Key of an item of ``axes`` or ``io`` that names its node."""

    def problems(self, nodes: Collection[int]) -> Iterator[str]:
        """Yield what else is wrong; ``nodes`` are those of axes and modules."""
        return iter(())

    @model_validator(mode="before")
    @classmethod
    def _with_defaults(cls, data: Any) -> Any:
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
        kind, given = self.node_kind, vars(self)
        drives = [(getattr(axis, kind), axis.axis_offset) for axis in given["axes"]]
        modules = [getattr(module, kind) for module in given["io"]]
        taken = {node for node, _ in drives}

        def doubled(values: Sequence[Any]) -> list[Any]:
            return [value for value, count in Counter(values).items() if count > 1]

        problems = (
            *(f"axis {n} is given twice" for n in doubled([axis.axis for axis in given["axes"]])),
            *(f"{kind} {n} is given twice with axis_offset {o}" for n, o in doubled(drives)),
            *(f"{kind} {node} is given twice" for node in doubled(modules)),
            *(f"{kind} {node} is given twice" for node in modules if node in taken),
            *self.problems({*taken, *modules}),
        )
        if problems:
            raise ValueError("; ".join(dict.fromkeys(problems)))
        return self


def with_robot_ramps(drives: Sequence[Drive], robot: RobotDescriptor) -> tuple[Drive, ...]:
    """Return ``drives`` with the robot's ramp of a controlled stop, where they have none."""

    def filled(drive: Drive) -> Drive:
        ramps = robot.stop_decelerations
        ramp = ramps[drive.axis] if drive.axis < len(ramps) else None
        if ramp is None or "stop_deceleration_rad_s2" in drive.model_fields_set:
            return drive
        return drive.model_copy(update={"stop_deceleration_rad_s2": ramp})

    return tuple(filled(drive) for drive in drives)


def parse_object(name: str) -> tuple[int, int]:
    """Parse ``0x60C1:1`` to (0x60C1, 1); without a subindex it is 0."""
    index, _, sub = name.partition(":")
    return int(index, 16), int(sub or 0)


class OptionProblems:
    """Everything that is wrong with the section of a backend.

    Attributes:
        found: problems, with their keys.
    """

    def __init__(self, robot: RobotDescriptor, section: str) -> None:
        self.found: list[DescriptorError] = []
        self._robot, self._section = robot, section

    def add(self, key: str, what: str) -> None:
        key = f"{self._section}.{key}"
        self.found.append(DescriptorError(what, path=self._robot.path, key=key))

    def check_axes(self, drives: Sequence[DriveOptions]) -> None:
        """Name axes of the robot without a drive, and drives without an axis."""
        axes = self._robot.axes
        given, known = {drive.axis for drive in drives}, set(range(axes))
        for axis in sorted(known - given):
            self.add("axes", f"axis {axis} of the robot has no drive")
        for axis in sorted(given - known):
            what = f"axis {axis} does not exist, the robot has axes 0 to {axes - 1}"
            self.add("axes", what)

    def require_none(self) -> None:
        """Raise DescriptorError with all of them."""
        if self.found:
            raise DescriptorError.join(self.found)
