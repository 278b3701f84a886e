"""Gripper in the model: fingers that follow the output bit with a limited force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np

from robotd.api import RobotDescriptor, get_logger
from robotd_mujoco.options import MujocoOptions

FINGER_TRAVEL_S = 0.3  # where the robot's file has no travel time
FINGER_ROTOR_KG = 0.2
GRIP_DEPTH = 0.05  # share of the stroke by which a part is squeezed at full force
STIFF_REFERENCE, STIFF_IMPEDANCE = 2.0, [0.9999, 0.9999, 0.001, 0.5, 2.0]  # steps; see solimp

log = get_logger("mujoco")


@dataclass(frozen=True)
class Finger:
    """One finger of the gripper.

    Attributes:
        qpos: address of its position.
        motor: number of its actuator, which follows a position with a limited force.
        factor: its position per position of the gripper.
        body: number of its link.
    """

    qpos: int
    motor: int
    factor: float
    body: int


def add_gripper(spec: mujoco.MjSpec, robot: RobotDescriptor, options: MujocoOptions) -> None:
    """Give each finger a motor, and let the fingers move together.

    A finger follows a position with a limited force.
    """
    gripper = robot.gripper
    if gripper is None or any(spec.joint(name) is None for name in gripper.joints):
        if gripper is not None:
            log.warning("the fingers are not in the model", joints=", ".join(gripper.joints))
        return
    multipliers = gripper.multipliers or (1.0,) * len(gripper.joints)
    force = options.gripper_force_n
    stiffness = force / (GRIP_DEPTH * abs(gripper.closed_m - gripper.open_m))
    damping = 2.0 * float(np.sqrt(stiffness * FINGER_ROTOR_KG))
    coupled = {
        equality.name1 for equality in spec.equalities if equality.type == mujoco.mjtEq.mjEQ_JOINT
    }
    for name in gripper.joints:
        joint = spec.joint(name)
        joint.armature = max(joint.armature, FINGER_ROTOR_KG)
        joint.solref_limit = [STIFF_REFERENCE * options.step_s, 1.0]
        joint.solimp_limit = STIFF_IMPEDANCE
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        spec.add_actuator(
            name=f"{name}_motor", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED, biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            forcerange=[-force, force], forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            gainprm=[stiffness, *[0.0] * 9], biasprm=[0.0, -stiffness, -damping, *[0.0] * 7],
        )  # fmt: skip
        for geom in joint.parent.geoms:
            geom.friction[0] = options.finger_friction
            geom.priority = 1  # the friction of a contact is that of the finger
    for (leader, first), (name, factor) in pairwise(zip(gripper.joints, multipliers, strict=True)):
        if name in coupled or leader in coupled:
            continue
        lock = spec.add_equality(
            name=f"{name}_coupling", type=mujoco.mjtEq.mjEQ_JOINT, name1=name, name2=leader
        )
        lock.objtype = mujoco.mjtObj.mjOBJ_JOINT
        make_stiff(lock, options)
        lock.data[:5] = [0.0, factor / first if first else 0.0, 0.0, 0.0, 0.0]


def make_stiff(equality: Any, options: MujocoOptions) -> None:
    """Let a constraint act within two steps, and yield by micrometres."""
    equality.solref = [STIFF_REFERENCE * options.step_s, 1.0]
    equality.solimp = STIFF_IMPEDANCE


def find_fingers(model: mujoco.MjModel, robot: RobotDescriptor) -> list[Finger]:
    """Return the fingers of a compiled model, in the order of the robot's file."""
    gripper = robot.gripper
    names: Sequence[str] = gripper.joints if gripper else ()
    known = {model.actuator(number).name for number in range(model.nu)}
    if gripper is None or not {f"{name}_motor" for name in names} <= known:
        return []
    multipliers: Sequence[float] = gripper.multipliers or (1.0,) * len(names)
    return [
        Finger(
            int(model.joint(name).qposadr[0]),
            model.actuator(f"{name}_motor").id,
            float(factor),
            int(model.jnt_bodyid[model.joint(name).id]),
        )
        for name, factor in zip(names, multipliers, strict=True)
    ]
