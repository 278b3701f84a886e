"""Mobile base in the model: a free root on wheels, with casters and mecanum rollers.

Wheels are those of the URDF and roll by friction. The rollers of mecanum wheels are not bodies:
each wheel touches the floor without friction, and an actuator below it drives the base along the
axis of its roller, with a force in proportion to the slip and limited by friction times load.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from robotd.api import FloatArray, RobotDescriptor, get_logger
from robotd_mujoco.options import MujocoOptions

ROOT_JOINT = "robot_root"
CREEP_N_S_M = 5000.0  # force of a roller per m/s of slip, below the limit of friction
# Which way the roller on the floor lies: its axis is ahead and to the right, or to the left.
ROLLER_YAW_RAD = (-np.pi / 4, np.pi / 4, np.pi / 4, -np.pi / 4)
ROLLER_SHARE = np.cos(np.pi / 4)  # of the speed of the rim, along the axis

log = get_logger("mujoco")


@dataclass(frozen=True)
class Rollers:
    """Rollers of all mecanum wheels of a base.

    Attributes:
        motors: (4,) actuators along the axes of the rollers.
        dofs: (4,) of the wheels.
        loads: (4,) addresses of the forces between wheels and floor.
        rim_m: m along the axis of a roller per rad of its wheel.
        friction: coefficient.
    """

    motors: Any
    dofs: Any
    loads: Any
    rim_m: float
    friction: float

    def drive(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set speed and limit of the forces for the next step, and load the drives with them."""
        limits = self.friction * data.sensordata[self.loads]
        model.actuator_forcerange[self.motors, 0] = -limits
        model.actuator_forcerange[self.motors, 1] = limits
        data.ctrl[self.motors] = self.rim_m * data.qvel[self.dofs]
        data.qfrc_applied[self.dofs] = -self.rim_m * data.actuator_force[self.motors]


def is_free(robot: RobotDescriptor, options: MujocoOptions, spec: mujoco.MjSpec) -> bool:
    """Return True for a base on wheels, whose root can move."""
    if spec.worldbody.first_body() is None:
        return False
    if options.fixed_root is not None:
        return not options.fixed_root
    wheels = robot.drive.wheel_joints if robot.drive else ()
    return bool(wheels) and all(spec.joint(name) is not None for name in wheels)


def add_base(spec: mujoco.MjSpec, robot: RobotDescriptor, options: MujocoOptions) -> None:
    """Free the root, put the wheels on the floor, and give them their friction.

    Spheres of links that do not move on the base are casters: they slide without friction.
    """
    root = spec.worldbody.first_body()
    root.add_freejoint(name=ROOT_JOINT)
    for body in _rigid_bodies(root):
        for geom in body.geoms:
            if geom.type == mujoco.mjtGeom.mjGEOM_SPHERE:
                _make_slippery(geom)
    if robot.drive is None:
        return
    wheels = [spec.joint(name).parent for name in _wheel_names(robot)]
    has_rollers = robot.drive.kind == "mecanum"
    for wheel in wheels:
        for geom in wheel.geoms:
            geom.friction[0], geom.condim, geom.priority = options.wheel_friction, 3, 2
            if has_rollers:
                _make_slippery(geom)
    radius = robot.drive.wheel_radius_m
    if has_rollers:
        for wheel, yaw in zip(wheels, ROLLER_YAW_RAD, strict=True):
            _add_roller(spec, wheel, radius, yaw)
    _lift(spec, root, wheels, radius)


def find_rollers(
    model: mujoco.MjModel, robot: RobotDescriptor, options: MujocoOptions
) -> Rollers | None:
    """Return the rollers of a compiled model; None: it has none."""
    known = {model.actuator(number).name for number in range(model.nu)}
    names = [f"{name}_roller" for name in _wheel_names(robot)]
    if robot.drive is None or not names or not set(names) <= known:
        return None
    return Rollers(
        motors=np.array([model.actuator(name).id for name in names]),
        dofs=np.array([int(model.joint(name).dofadr[0]) for name in _wheel_names(robot)]),
        loads=np.array([int(model.sensor(name).adr[0]) for name in names]),
        rim_m=float(ROLLER_SHARE * robot.drive.wheel_radius_m),
        friction=options.wheel_friction,
    )


def carried_inertia(model: mujoco.MjModel, robot: RobotDescriptor) -> dict[str, FloatArray]:
    """Return what a base adds to the inertia of each of its driven wheels, kg·m²."""
    if robot.drive is None or not has_free_root(model):
        return {}
    names = _wheel_names(robot)
    share = np.array(model.body_mass.sum() * robot.drive.wheel_radius_m**2 / len(names))
    return dict.fromkeys(names, share)


def has_free_root(model: mujoco.MjModel) -> bool:
    """Return True where ``add_base`` has been called."""
    return ROOT_JOINT in {model.joint(number).name for number in range(model.njnt)}


def _wheel_names(robot: RobotDescriptor) -> list[str]:
    """Return the joints of the driven wheels, without those that steer."""
    if robot.drive is None:
        return []
    pairs = zip(robot.drive.axes, robot.drive.wheel_joints, strict=False)
    return [name for axis, name in pairs if axis not in robot.drive.steering_axes]


def _rigid_bodies(body: Any) -> Iterator[Any]:
    """Yield a body and all that is fixed to it."""
    yield body
    for child in body.bodies:
        if not child.joints:
            yield from _rigid_bodies(child)


def _make_slippery(geom: Any) -> None:
    geom.condim, geom.priority = 1, 2


def _add_roller(spec: mujoco.MjSpec, wheel: Any, radius: float, yaw: float) -> None:
    """Add the actuator below a wheel, and the sensor of its load."""
    name = f"{wheel.joints[0].name}_roller"
    below = wheel.pos - np.array([0.0, 0.0, radius])
    turn = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
    wheel.parent.add_site(name=name, pos=below, quat=turn)
    spec.add_actuator(
        name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_SITE, gear=[1.0, *[0.0] * 5],
        gaintype=mujoco.mjtGain.mjGAIN_FIXED, biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        gainprm=[CREEP_N_S_M, *[0.0] * 9], biasprm=[0.0, 0.0, -CREEP_N_S_M, *[0.0] * 7],
        forcerange=[-1.0, 1.0], forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
    )  # fmt: skip
    wheel.add_site(name=f"{name}_tread", size=[2.0 * radius] * 3)
    spec.add_sensor(
        name=name, type=mujoco.mjtSensor.mjSENS_TOUCH, objname=f"{name}_tread",
        objtype=mujoco.mjtObj.mjOBJ_SITE,
    )  # fmt: skip


def _lift(spec: mujoco.MjSpec, root: Any, wheels: list[Any], radius: float) -> None:
    """Put the axles of the wheels at their radius above the floor."""
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    axle = float(np.mean([data.body(wheel.name).xpos[2] for wheel in wheels]))
    root.pos = root.pos + np.array([0.0, 0.0, radius - axle])
