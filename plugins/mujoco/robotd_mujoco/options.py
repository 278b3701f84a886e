"""Model of the descriptor section ``backends.mujoco``; every key ends in its unit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from robotd.api import BackendOptions, DescriptorError, RobotDescriptor

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class MujocoOptions(BackendOptions):
    """Options of the physics, the drives and the surroundings."""

    scene: str | None = Field(
        None,
        description="File of the surroundings, relative to the robot's file: a scene in YAML, or"
        " MJCF with the suffix `.xml`; null: none.",
    )
    mjcf: str | None = Field(
        None,
        description="MJCF of the robot, relative to the robot's file, instead of the URDF. Its"
        " joints have the names of the robot's joints; its actuators, and the sensors of these,"
        " are not used.",
    )
    mjcf_joints: dict[str, str] = Field(
        {},
        description="Names that joints of the robot have in the MJCF, where these are others:"
        " `{waist: vx300s_left/waist}`.",
    )
    base_m: tuple[Finite, Finite, Finite] = Field(
        (0.0, 0.0, 0.0), description="Position of the robot's root in the scene."
    )
    fixed_root: bool | None = Field(
        None,
        description="The root of the robot stays where it is; null: unless it is a base whose"
        " wheels are in its URDF. Such a base stands on a floor, at the height of its wheels.",
    )
    wheel_friction: Positive = Field(
        0.8, description="Friction coefficient of the wheels of a base, whatever they touch."
    )
    step_s: float = Field(0.001, ge=0.000_1, le=0.005, description="Step of the physics.")
    gravity_m_s2: tuple[Finite, Finite, Finite] = Field((0.0, 0.0, -9.81), description="Gravity.")
    bandwidth_hz: Positive = Field(
        50.0, le=100, description="Position loop of the drives, critically damped."
    )
    rotor_inertia_kg_m2: NotNegative = Field(
        0.05, description="Inertia of motor and gear at the joint; kg for a prismatic one."
    )
    viscous_friction_nm_s: NotNegative = Field(
        1.0, description="Torque per rad/s, unless the URDF has `<dynamics>`."
    )
    following_error_rad: Positive = Field(
        0.2, description="Distance from the command, rad or m, at which a drive goes into alarm."
    )
    brakes: bool = Field(
        True, description="Brakes hold joints whose servo is off; false: they fall."
    )
    self_collision: bool = Field(
        True,
        description="Links touch each other, except neighbours and those that touch at the start.",
    )
    gripper_force_n: Positive = Field(40.0, description="Force of each finger of the gripper.")
    finger_friction: Positive = Field(
        1.0, description="Friction coefficient of the fingers, whatever they touch."
    )
    initial_position_rad: tuple[Finite, ...] | None = Field(
        None,
        description="Position of the axes at the start, in m if prismatic; null: 0, or the nearest"
        " one inside the limits of the joint.",
    )
    seed: int = Field(0, ge=0, description="Seed of the noise.")
    torque_noise_nm: NotNegative = Field(0.0, description="Standard deviation of the torque.")
    velocity_noise_rad_s: NotNegative = Field(0.0, description="The same of the velocity.")
    max_catch_up_s: Positive = Field(
        0.1, description="Simulated time made up for at once after a pause; more is dropped."
    )

    def check_robot(self, robot: RobotDescriptor) -> Any:
        """Return the options. Raises DescriptorError: a file is missing, or a wrong length."""
        problems = []
        for key in ("scene", "mjcf"):
            name = getattr(self, key)
            if name is not None and not robot_file(robot, name).is_file():
                what = f"file {robot_file(robot, name)} does not exist"
                problems.append(DescriptorError(what, key=f"backends.mujoco.{key}"))
        positions = self.initial_position_rad
        if positions is not None and len(positions) != robot.axes:
            what = f"has {len(positions)} positions, the robot has {robot.axes} axes"
            key = "backends.mujoco.initial_position_rad"
            problems.append(DescriptorError(what, key=key))
        if problems:
            raise DescriptorError.join(problems)
        return self


def robot_file(robot: RobotDescriptor, name: str) -> Path:
    """Return a file that the robot's file names."""
    return (robot.path.parent if robot.path else Path()) / name
