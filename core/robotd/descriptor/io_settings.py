"""Digital I/O of a robot: named bits, the gripper, and the input that stops motion."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, WithJsonSchema

from robotd.descriptor.section import Name, NotNegative, Problem, Section, twice

IMAGE_BYTES = 8000
_ADDRESS = re.compile(r"([0-9]{1,4})\.([0-7])")


class IoAddress(NamedTuple):
    """One bit of an I/O image; ``str`` gives ``byte.bit``, as in a descriptor."""

    byte: int
    bit: int

    def __str__(self) -> str:
        return f"{self.byte}.{self.bit}"


def _address(value: Any) -> Any:
    """Parse ``byte.bit``, which YAML reads as a number."""
    if isinstance(value, IoAddress):
        return value
    text = str(value) if isinstance(value, float | str) else ""
    match = _ADDRESS.fullmatch(text)
    if match is None or int(match[1]) >= IMAGE_BYTES:
        raise ValueError(f"must be byte.bit, 0.0 to {IMAGE_BYTES - 1}.7, such as 0.3")
    return IoAddress(int(match[1]), int(match[2]))


IoNames = dict[
    Name,
    Annotated[
        IoAddress,
        BeforeValidator(_address),
        WithJsonSchema({"type": "string", "format": "byte.bit"}),
    ],
]
"""Bits by their names; a name is a part of a ROS topic."""


class PartSensorSettings(Section):
    """An input that is 1 while the gripper holds a part."""

    input_byte: int = Field(ge=0, lt=IMAGE_BYTES, description="Byte of the input image.")
    input_bit: int = Field(ge=0, le=7, description="Bit in that byte.")


class GripperSettings(Section):
    """A gripper on one output bit; its fingers are reported as joints."""

    output_byte: int = Field(ge=0, lt=IMAGE_BYTES, description="Byte of the output image.")
    output_bit: int = Field(ge=0, le=7, description="Bit in that byte; 1 closes the gripper.")
    joints: tuple[Name, ...] = Field(
        strict=False, min_length=1, description="Finger joints, reported after the arm's joints."
    )
    multipliers: tuple[float, ...] = Field(
        (),
        strict=False,
        description="Position of each finger joint per position of the gripper, as `<mimic>` of a"
        " URDF has it; empty: 1 each.",
    )
    open_m: float = Field(description="Position when open; rad for fingers that turn.")
    closed_m: float = Field(description="Position when closed; rad for fingers that turn.")
    travel_time_s: NotNegative = Field(
        0.0, description="Time from one end to the other; 0 reports the end at once."
    )

    part_sensor: PartSensorSettings | None = Field(
        None, description="Input that shows a part; null: the gripper has none."
    )

    def problems(self) -> Iterator[Problem]:
        yield from twice("joints", enumerate(self.joints))
        if self.multipliers and len(self.multipliers) != len(self.joints):
            what = f"must be as many as joints ({len(self.joints)}), or none"
            yield ("multipliers",), what, self.multipliers
        if self.open_m == self.closed_m:
            yield ("closed_m",), "must differ from open_m", self.closed_m


class StopInputSettings(Section):
    """An input that stops all motion, such as a contact of a safety relay."""

    input_byte: int = Field(ge=0, lt=IMAGE_BYTES, description="Byte of the input image.")
    input_bit: int = Field(ge=0, le=7, description="Bit in that byte.")
    motion_level: int = Field(
        1, ge=0, le=1, description="Level that allows motion; with 1 a broken wire stops."
    )
