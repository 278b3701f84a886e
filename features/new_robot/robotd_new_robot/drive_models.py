"""Drive models for the simulation, from the masses and efforts of a URDF."""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api.models import UrdfJoint, UrdfRobot

COULOMB_SHARE = 0.02  # of the effort limit
VISCOUS_SHARE = 0.03  # of the effort limit, at full speed
DEFAULT_FRICTION = (2.0, 1.0)  # of the simulation
DIGITS = 3


def inertia(urdf: UrdfRobot, joint: UrdfJoint) -> float:
    """Return what ``joint`` moves at position 0: kg·m² about its axis, or kg if prismatic.

    0.0 where the links have no mass.
    """
    about = urdf.pose(joint.child, {})
    axis = about[:3, :3] @ joint.axis
    total = 0.0
    for name in urdf.subtree(joint.child):
        link = urdf.links[name]
        if link.mass is None:
            continue
        if joint.type == "prismatic":
            total += link.mass
            continue
        pose = urdf.pose(name, {})
        tensor = pose[:3, :3] @ link.inertia @ pose[:3, :3].T
        arm = (pose @ [*link.center, 1.0])[:3] - about[:3, 3]
        across = arm - (arm @ axis) * axis
        total += float(axis @ tensor @ axis + link.mass * across @ across)
    return total


def friction(joint: UrdfJoint) -> tuple[float, float]:
    """Return coulomb friction and viscous friction per unit/s, from the effort limit."""
    if not joint.effort or not joint.velocity:
        return DEFAULT_FRICTION
    return COULOMB_SHARE * joint.effort, VISCOUS_SHARE * joint.effort / joint.velocity


def per_axis(urdf: UrdfRobot, joints: Sequence[UrdfJoint]) -> dict[str, list[float]]:
    """Return lists for ``backends.sim``, one figure per axis, without lists of zeros."""
    frictions = [friction(joint) for joint in joints]
    lists = {
        "inertia_kg_m2": [inertia(urdf, joint) for joint in joints],
    }
    if set(frictions) != {DEFAULT_FRICTION}:
        lists["coulomb_friction_nm"] = [pair[0] for pair in frictions]
        lists["viscous_friction_nm_s"] = [pair[1] for pair in frictions]
    return {
        key: [float(f"{value:.{DIGITS}g}") for value in values]
        for key, values in lists.items()
        if any(values)
    }
