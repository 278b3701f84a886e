"""A kind of base of a third party with two axles, both of which steer and drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.core.control.base_harness import BaseHarness, running

from robotd.clock.simulated import SteppedClock
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.device.state import CommandMode
from robotd.errors import PluginError
from robotd.motion.planar import PlanarTwist
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

Install = Callable[..., Path]

SOURCE = '''
import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from robotd.api.bases import Axis, DriveSettings, PlanarTwist, Positive, SteeringAxis

VELOCITY, ACCELERATION = 2.0, 8.0


class CrabDrive(DriveSettings):
    AXIS_KEYS = ("front_axis", "front_steering_axis", "rear_axis", "rear_steering_axis")
    KINEMATICS = "plugin_acme:kinematics"

    kind: Literal["crab"]
    front_axis: Axis
    front_steering_axis: Axis
    rear_axis: Axis
    rear_steering_axis: Axis
    wheelbase_m: Positive

    @property
    def steering(self):
        axes = self.front_steering_axis, self.rear_steering_axis
        return tuple(SteeringAxis(axis, -1.0, 1.0, VELOCITY, ACCELERATION) for axis in axes)


class CrabFollower:
    """Turns the axles to opposite sides at once; the wheels wait until both are there."""

    def __init__(self, wheels, angles, acceleration, period_s):
        self.wheels, self.angles, self.period_s = wheels, tuple(angles), period_s
        self.acceleration = acceleration
        self.rates, self.rims = [0.0, 0.0], [0.0, 0.0]

    @property
    def at_rest(self):
        return not any(self.rates) and not any(self.rims)

    @property
    def velocities(self):
        return self.rims[0], self.rates[0], self.rims[1], self.rates[1]

    @property
    def twist(self):
        return self.wheels.twist(self.rims[0], self.angles[0], self.rims[1], self.angles[1])

    def step(self, twist):
        front, angle, rear, other = self.wheels.speeds(twist)
        if twist == PlanarTwist(0.0, 0.0):
            angle, other = self.angles
        for place, target in enumerate((angle, other)):
            missing = target - self.angles[place]
            step = ACCELERATION * self.period_s
            stopping = math.sqrt(ACCELERATION * abs(missing)) / 2
            wanted = math.copysign(min(VELOCITY, stopping, abs(missing) / self.period_s), missing)
            rate = self.rates[place] + max(-step, min(step, wanted - self.rates[place]))
            self.rates[place] = 0.0 if abs(missing) < 1e-6 else rate
        self.angles = tuple(a + r * self.period_s for a, r in zip(self.angles, self.rates))
        there = abs(angle - self.angles[0]) < 0.01 and abs(other - self.angles[1]) < 0.01
        step = self.acceleration * self.period_s
        for place, speed in enumerate((front, rear)):
            wanted = speed if there else 0.0
            self.rims[place] += max(-step, min(step, wanted - self.rims[place]))


@dataclass(frozen=True)
class CrabWheels:
    moves_sideways: ClassVar[bool] = False
    turns_on_the_spot: ClassVar[bool] = False
    steered: ClassVar[tuple] = (1, 3)

    radius: float
    wheelbase: float

    @property
    def lever(self):
        return self.wheelbase / 2

    def speeds(self, twist):
        if not twist.linear:
            return 0.0, 0.0, 0.0, 0.0
        across = math.copysign(self.lever * twist.angular, twist.linear * twist.angular)
        angle = math.atan2(across, abs(twist.linear))
        rim = math.copysign(math.hypot(twist.linear, across), twist.linear) / self.radius
        return rim, angle, rim, -angle

    def twist(self, *turns):
        front, angle, rear, other = turns
        rim = (front + rear) / 2 * self.radius
        mean = (angle - other) / 2
        return PlanarTwist(rim * math.cos(mean), rim * math.sin(mean) / self.lever)

    def follower(self, angles, acceleration, period_s):
        return CrabFollower(self, angles, acceleration, period_s)


def kinematics(drive):
    return CrabWheels(drive.wheel_radius_m, drive.wheelbase_m)
'''
ROBOT = """\
schema: 1
name: crab
cycle: {rate_hz: 200}
drive:
  kind: crab
  front_axis: 0
  front_steering_axis: 1
  rear_axis: 2
  rear_steering_axis: 3
  wheel_radius_m: 0.1
  wheelbase_m: 0.8
  velocity_m_s: 1.0
  acceleration_m_s2: 1.0
  deceleration_m_s2: 1.0
  angular_velocity_rad_s: 1.0
  angular_acceleration_rad_s2: 2.0
  angular_deceleration_rad_s2: 2.0
"""

Load = Callable[..., RobotDescriptor]


@pytest.fixture
def load(install: Install, tmp_path: Path) -> Load:
    """Load the robot with the kind, whose source has ``old`` replaced by ``new``."""

    def loaded(old: str = "", new: str = "") -> RobotDescriptor:
        site = install("crab", SOURCE.replace(old, new), group="robotd.bases")
        entries = next(site.glob("*.dist-info")) / "entry_points.txt"
        entries.write_text("[robotd.bases]\ncrab = plugin_acme:CrabDrive\n", encoding="utf-8")
        file = tmp_path / "robot.yaml"
        file.write_text(ROBOT, encoding="utf-8")
        return load_robot_descriptor(file)

    return loaded


def test_both_axles_steer_and_the_base_runs_on_its_arc(load: Load) -> None:
    for harness in running(load()):
        drive(harness)


def drive(harness: BaseHarness) -> None:
    robot = harness.robot
    modes = [CommandMode.VELOCITY, CommandMode.POSITION] * 2
    assert robot.image.mode[:4].tolist() == modes
    assert [limits.upper for limits in robot.axes.limits] == [math.inf, 1.0, math.inf, 1.0]
    assert robot.descriptor.stop_decelerations == (10.0, 8.0, 10.0, 8.0)
    harness.drive(0.3, 0.3, 4.0)
    angle = math.atan2(0.4 * 0.3, 0.3)
    assert robot.image.position[[1, 3]].tolist() == pytest.approx([angle, -angle], abs=2e-3)
    assert harness.twist == pytest.approx(PlanarTwist(0.3, 0.3), abs=5e-3)
    assert harness.base.limited == pytest.approx(PlanarTwist(0.3, 0.3), abs=5e-3)
    harness.drive(0.0, 0.0, 0.1)
    harness.run(3.0)
    assert not harness.base.moving
    assert harness.base.pose.heading > 0.5
    assert robot.image.position[1] == pytest.approx(angle, abs=2e-3)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "def follower(",
            "def follow(",
            "plugin_acme:kinematics returns no SteeredKinematics: CrabWheels has no follower",
        ),
        ("= (1, 3)", "= (1,)", r"plugin_acme:kinematics steers \(1,\), its settings \(1, 3\)"),
        ("def lever(", "def lever_m(", "returns no SteeredKinematics"),
    ],
)
def test_kinematics_that_do_not_fit_are_named(load: Load, old: str, new: str, says: str) -> None:
    with pytest.raises(PluginError, match=f"'crab' of acme 1.2: .*{says}"):
        Robot(load(old, new), load_backend("sim"), SteppedClock())
