"""Arms of the tests of tool space."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotd.api import FloatArray, read_urdf
from robotd_tool_space import Kinematics
from robotd_tool_space.paths.tool_motion import plan_joint_motion
from robotd_tool_space.robot_tool import RobotTool

ROOT = Path(__file__).parents[3]
FILES = {
    "cr3a": ("robots/cr3a/cr3a.urdf", "joint", 6),
    "six_axis": ("tests/urdf/six_axis.urdf", "joint", 6),
    "seven_axis": ("tests/urdf/seven_axis.urdf", "joint", 7),
    "scara": ("tests/urdf/scara.urdf", "joint", 4),
    "gantry": ("tests/urdf/gantry.urdf", "gantry_joint", 3),
}


def file_of(name: str) -> Path:
    return ROOT / FILES[name][0]


def kinematics_of(name: str) -> Kinematics:
    """Kinematics of an arm up to the link of its last joint."""
    _, prefix, count = FILES[name]
    urdf = read_urdf(file_of(name))
    names = [f"{prefix}{number}" for number in range(1, count + 1)]
    return Kinematics.of_urdf(urdf, names, urdf.joint[names[-1]].child)


def random_positions(arm: Kinematics, count: int, seed: int = 1) -> FloatArray:
    """Positions within the limits, (count, n); those of a continuous joint within a turn."""
    lower = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    upper = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    return np.random.default_rng(seed).uniform(lower, upper, (count, len(lower)))


def go(tool: RobotTool, position: FloatArray) -> None:
    """Move the joints of a tool to a position, at full speed."""
    limits, speed = tool.group.follower.limits, tool.speed
    tool.execute(plan_joint_motion(tool.kinematics, limits, tool.start(), position, speed))
