"""Gravity compensation: torques that carry the links, from the masses of the URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.descriptor.urdf.urdf_model import UrdfJoint, UrdfRobot

STANDARD_GRAVITY = 9.80665  # m/s²


@dataclass(frozen=True, eq=False)
class _Body:
    """A joint with a known position, perhaps as a mimic joint, and all that is fixed to its child.

    Attributes:
        parent: number of the body that holds it; -1: the root.
        origin: frame of the joint at position 0 in that of the parent's joint; shape (4, 4).
        column, ratio, offset: its position is ratio · that of the known joint + offset.
        moment: mass times its centre in the frame of the joint's child, kg·m; shape (3,).
    """

    joint: UrdfJoint
    parent: int
    origin: FloatArray
    column: int
    ratio: float
    offset: float
    mass: float
    moment: FloatArray


class GravityModel:
    """Gravity torques of joints, of all masses that they carry. Immutable; any thread.

    Gravity is along -z of the root of the URDF. A joint that follows none of ``names`` is fixed at
    its position 0, and links without an inertial have no mass.

    Args:
        urdf: the robot.
        names: joints whose positions are known, in the order of ``torques``.
    """

    def __init__(self, urdf: UrdfRobot, names: Sequence[str]) -> None:
        self._count = len(names)
        self._bodies = _bodies(urdf, names)

    def torques(self, positions: FloatArray) -> FloatArray:
        """Return the torques at rest, N·m or N; shape (n,).

        Of joint i that is g_i(q) = -Σ_j m_j g₀ᵀ J_ij(q), where column J_ij is the velocity of the
        centre of mass j for a unit velocity of the joint (Siciliano, Sciavicco, Villani, Oriolo:
        Robotics, 2009, 7.1). The sum over the links that the joint carries needs their common
        mass and centre only.

        Args:
            positions: of the joints, rad or m; shape (n,).
        """
        bodies = self._bodies
        poses: list[FloatArray] = []
        carried: list[FloatArray] = []  # mass times centre in the root, kg·m
        masses = [body.mass for body in bodies]
        for body in bodies:
            position = body.ratio * float(positions[body.column]) + body.offset
            pose = body.origin @ body.joint.motion(position)
            if body.parent >= 0:
                pose = poses[body.parent] @ pose
            poses.append(pose)
            carried.append(pose[:3, :3] @ body.moment + body.mass * pose[:3, 3])
        torques = np.zeros(self._count)
        for number in reversed(range(len(bodies))):
            body, pose = bodies[number], poses[number]
            axis = pose[:3, :3] @ body.joint.axis
            if body.joint.type == "prismatic":
                lifted = masses[number] * axis[2]
            else:
                arm = carried[number] - masses[number] * pose[:3, 3]
                lifted = axis[0] * arm[1] - axis[1] * arm[0]
            torques[body.column] += body.ratio * STANDARD_GRAVITY * lifted
            if body.parent >= 0:
                masses[body.parent] += masses[number]
                carried[body.parent] = carried[body.parent] + carried[number]
        return torques

    @property
    def massless(self) -> list[str]:
        """Links that a joint moves and that have no mass, nor has anything fixed to them."""
        return [body.joint.child for body in self._bodies if not body.mass > 0.0]


def _bodies(urdf: UrdfRobot, names: Sequence[str]) -> list[_Body]:
    """Return the bodies, each behind the one that holds it."""
    columns = {name: column for column, name in enumerate(names)}
    holders: dict[str, tuple[int, FloatArray]] = {urdf.root: (-1, np.eye(4))}
    found: list[tuple[UrdfJoint, int, FloatArray]] = []
    loads: list[tuple[float, FloatArray]] = []
    for joint in urdf.joints:  # a parent comes before its children
        holder, place = holders[joint.parent]
        if joint.moves and urdf.leader(joint, columns)[0].name in columns:
            found.append((joint, holder, place @ joint.origin))
            loads.append((0.0, np.zeros(3)))
            holder, place = len(found) - 1, np.eye(4)
        else:
            place = place @ joint.transform(urdf.position(joint, {}))
        holders[joint.child] = holder, place
        link = urdf.links[joint.child]
        if holder >= 0 and link.mass:
            mass, moment = loads[holder]
            centre = place[:3, :3] @ link.center + place[:3, 3]
            loads[holder] = mass + link.mass, moment + link.mass * centre
    bodies = []
    for (joint, holder, origin), load in zip(found, loads, strict=True):
        leader, ratio, offset = urdf.leader(joint, columns)
        bodies.append(_Body(joint, holder, origin, columns[leader.name], ratio, offset, *load))
    return bodies
