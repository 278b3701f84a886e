"""Keys of a robot's file for servos on a serial bus, and what follows from them and the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field

from robotd.api import BackendOptions, DescriptorError, RobotDescriptor
from robotd_serial_servo.calibration import (
    RAD_PER_TICK,
    JointCalibration,
    Scale,
    read_calibration,
)
from robotd_serial_servo.servo_bus import TICKS_PER_TURN

SPEED_MARGIN = 1.2  # of a goal over the joint's limit: it bounds a fault, not a motion
NO_LOAD_RAD_S = 5.0  # of an axis without a joint
Part = Annotated[float, Field(gt=0, le=1)]


class ServoKeys(BaseModel):
    """One servo: an item of ``axes``."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    axis: int = Field(ge=0, description="Axis of the robot that the servo moves.")
    servo: int = Field(ge=0, le=252, description="Id of the servo on the bus.")
    model: str | None = Field(
        None, description="Model that must answer, such as sts3215; null: any."
    )
    polarity: int = Field(1, description="1, or -1 where the joint turns against the servo.")
    zero_tick: float | None = Field(
        None,
        description="Position of the servo at 0 rad, without a calibration; null: the middle of the"
        " calibrated range.",
    )
    middle_rad: float = Field(
        0.0,
        ge=-2.0 * math.pi,
        le=2.0 * math.pi,
        description="Angle of the joint in the middle of its calibrated range. A gripper whose URDF"
        " has 0 at its closed end needs one.",
    )
    torque_limit: Part = Field(
        1.0, description="Highest fraction of the maximum torque; 0.5 spares a gripper."
    )


class SerialServoOptions(BackendOptions):
    """Port, calibration and servos; ``section`` is the dotted key of a backend's section."""

    section: ClassVar[str]

    port: str | None = Field(
        None, description="Device, such as /dev/ttyACM0, or a link in /dev/serial/by-id."
    )
    baudrate: int = Field(1_000_000, ge=9600, le=4_500_000, description="Bits per second.")
    calibration: Path | None = Field(
        None,
        description="Calibration file of LeRobot or of `robotd calibrate`, relative to the robot's"
        " file; null: `zero_tick` of each axis.",
    )
    exchange_period_s: float = Field(
        0.01, ge=0.002, le=0.05, description="Time between two exchanges with all servos."
    )
    reply_timeout_s: float = Field(
        0.008,
        ge=0.001,
        le=0.5,
        description="Time to the replies besides the time on the wire: two frames of USB, and the"
        " latency timer of the adapter.",
    )
    lost_after_s: float = Field(
        0.15,
        ge=0.02,
        le=1.0,
        description="Time without a reply after which a servo is offline; three replies at least.",
    )
    response_s: float = Field(
        0.1,
        ge=0.0,
        le=0.5,
        description="Time from a goal to its motion; a following error is the distance to the"
        " goal of that time before.",
    )
    free: bool = Field(
        False, description="The arm is moved by hand: its servos stay off. For leader arms."
    )
    axes: tuple[ServoKeys, ...] = Field((), strict=False, description="Servos, one for each axis.")

    def check_robot(self, robot: RobotDescriptor) -> ServoPlan:
        """Tie servos to joints. Raises DescriptorError with every problem."""
        return ServoPlan.make(robot, self)


@dataclass(frozen=True)
class PlannedServo:
    """One axis.

    Attributes:
        name: of its joint; ``axis N`` where it has none.
        scale: ticks and rad.
        calibration: None without a file.
        max_speed: at which a goal may move, ticks/s.
        torque_limit: fraction of the maximum torque.
    """

    axis: int
    name: str
    servo: int
    model: str | None
    scale: Scale
    calibration: JointCalibration | None
    torque_limit: float
    max_speed: float

    @property
    def range_ticks(self) -> tuple[int, int]:
        """Lowest and highest goal, ticks: of the calibration, or one turn."""
        if self.calibration is None:
            return 0, TICKS_PER_TURN - 1
        return (
            max(0, self.calibration.range_min),
            min(TICKS_PER_TURN - 1, self.calibration.range_max),
        )


@dataclass(frozen=True)
class ServoPlan:
    """Validated options, and a servo for each axis, in their order."""

    options: SerialServoOptions
    servos: tuple[PlannedServo, ...]

    @classmethod
    def make(cls, robot: RobotDescriptor, options: SerialServoOptions) -> ServoPlan:
        """Tie servos to joints. Raises DescriptorError with every problem."""
        section = options.section
        calibration = _calibration(robot, options, section)
        problems = [
            robot.problem(f"{section}.{key}", text) for key, text in _problems(robot, options)
        ]
        if problems:
            raise DescriptorError.join(problems)
        names = {joint.axis: joint.name for joint in robot.joints}
        speeds = {joint.axis: joint.velocity for joint in robot.joints}
        servos, unknown = [], list[str]()
        for keys in sorted(options.axes, key=lambda keys: keys.axis):
            name = names.get(keys.axis, f"axis {keys.axis}")
            joint = calibration.get(name)
            zero = keys.zero_tick if joint is None else _zero(keys, joint)
            if zero is None:
                unknown.append(name)
                continue
            if joint is not None and joint.id != keys.servo:
                text = f"{name} is servo {joint.id} in the calibration, {keys.servo} in axes"
                problems.append(robot.problem(f"{section}.calibration", text))
            speed = min(speeds.get(keys.axis, NO_LOAD_RAD_S), NO_LOAD_RAD_S)
            servos.append(
                PlannedServo(
                    keys.axis,
                    name,
                    keys.servo,
                    keys.model,
                    Scale(zero, keys.polarity),
                    joint,
                    keys.torque_limit,
                    SPEED_MARGIN * speed / RAD_PER_TICK,
                )
            )
        if unknown:
            text = f"no zero of {', '.join(unknown)} is known: 'robotd calibrate' measures it"
            advice = "name the file of LeRobot, or give each of axes its zero_tick"
            problems.append(robot.problem(f"{section}.calibration", f"{text}; {advice}"))
        if problems:
            raise DescriptorError.join(problems)
        return cls(options, tuple(servos))


def _zero(keys: ServoKeys, joint: JointCalibration) -> float:
    return joint.middle - keys.polarity * keys.middle_rad / RAD_PER_TICK


def _calibration(
    robot: RobotDescriptor, options: SerialServoOptions, section: str
) -> Mapping[str, JointCalibration]:
    if options.calibration is None:
        return {}
    path = options.calibration.expanduser()
    if robot.path is not None:
        path = robot.path.parent / path
    if not path.exists():
        raise robot.problem(f"{section}.calibration", f"there is no file {path}")
    return read_calibration(path)


def _problems(robot: RobotDescriptor, options: SerialServoOptions) -> Iterator[tuple[str, str]]:
    for what, values in (
        ("axis", [keys.axis for keys in options.axes]),
        ("servo", [keys.servo for keys in options.axes]),
    ):
        for value in sorted({value for value in values if values.count(value) > 1}):
            yield "axes", f"{what} {value} is used twice"
    given = {keys.axis for keys in options.axes}
    missing = sorted(set(range(robot.axes)) - given)
    if missing:
        yield "axes", f"no servo for axis {', '.join(map(str, missing))}"
    for keys in options.axes:
        if keys.axis >= robot.axes:
            yield "axes", f"axis {keys.axis} must be less than {robot.axes}"
        if abs(keys.polarity) != 1:
            yield "axes", f"polarity {keys.polarity} of axis {keys.axis} must be 1 or -1"
    if any(not math.isfinite(keys.zero_tick or 0.0) for keys in options.axes):
        yield "axes", "zero_tick must be finite"
