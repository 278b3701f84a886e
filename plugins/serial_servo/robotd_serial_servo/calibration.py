"""Scale of each servo, its ticks as an angle of its joint, and the calibration files of LeRobot."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from robotd.api import DescriptorError, read_limited
from robotd_serial_servo.servo_bus import TICKS_PER_TURN

MAX_BYTES = 100_000
RAD_PER_TICK = 2.0 * math.pi / TICKS_PER_TURN
MIDDLE = 2047  # where LeRobot puts the middle pose
OLD_KEYS = frozenset({"homing_offset", "start_pos", "end_pos", "calib_mode", "motor_names"})
Ticks = Annotated[int, Field(ge=-(1 << 20), le=1 << 20)]


class JointCalibration(BaseModel):
    """One joint of a file.

    Attributes:
        id: of the servo.
        drive_mode: 1 mirrors LeRobot's percentages; angles are not mirrored by it.
        homing_offset: ticks, stored in the servo.
        range_min, range_max: ends of the joint's travel, ticks from the offset.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", strict=True)

    id: int = Field(ge=0, le=253)
    drive_mode: int = Field(0, ge=0, le=1)
    homing_offset: Ticks
    range_min: Ticks
    range_max: Ticks

    @property
    def middle(self) -> float:
        """Position at which LeRobot's degrees are 0, ticks."""
        return 0.5 * (self.range_min + self.range_max)


_FILE = TypeAdapter(dict[str, JointCalibration])


@dataclass(frozen=True)
class Scale:
    """Ticks of a servo and rad of its joint.

    LeRobot's degrees count 4095 ticks for a turn. A turn has 4096: here angles are smaller by
    0.02 %, less than half a tick within a quarter of a turn of the middle.

    Attributes:
        zero: ticks at 0 rad.
        polarity: 1 or -1.
    """

    zero: float
    polarity: int = 1

    def angle(self, ticks: float) -> float:
        """Return rad of ``ticks``."""
        return self.polarity * (ticks - self.zero) * RAD_PER_TICK

    def ticks(self, angle: float) -> int:
        """Return the ticks nearest to ``angle``, rad."""
        return round(self.zero + self.polarity * angle / RAD_PER_TICK)


def read_calibration(path: Path) -> Mapping[str, JointCalibration]:
    """Read a file of LeRobot, by joint. Raises DescriptorError."""
    try:
        content = json.loads(read_limited(path, MAX_BYTES))
    except ValueError as error:  # JSON, or not UTF-8
        raise DescriptorError(f"is not a calibration: {error}", path=path) from None
    if isinstance(content, dict) and OLD_KEYS & content.keys():
        text = "is a calibration of LeRobot before 0.2, in lists: calibrate again"
        raise DescriptorError(text, path=path)
    try:
        joints = _FILE.validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or None
        raise DescriptorError(f"is not a calibration: {first['msg']}", path=path, key=key) from None
    for name, joint in joints.items():
        if not joint.range_min < joint.range_max:
            text = f"range_min {joint.range_min} is not below range_max {joint.range_max}"
            raise DescriptorError(text, path=path, key=name)
    return joints


def write_calibration(path: Path, joints: Mapping[str, JointCalibration]) -> None:
    """Write a file that LeRobot reads, whole or not at all. Raises OSError."""
    text = json.dumps({name: joint.model_dump() for name, joint in joints.items()}, indent=4)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)  # noqa: PTH105 - atomic, which is its purpose


def half_turn_offset(reported: int, offset: int, sign: int = 1) -> int:
    """Return the offset that makes the present position the middle, as LeRobot computes it.

    Args:
        reported: present position, ticks from ``offset``.
        offset: that the servo has now.
        sign: of the family, ``ServoBus.offset_sign``.
    """
    true = (reported + sign * offset) % TICKS_PER_TURN
    return sign * (true - MIDDLE)
