"""Tool space: kinematics of the arm, and motion of its tool.

The names below are for authors of features and programs.
"""

from typing import TYPE_CHECKING

from robotd.api import lazy_names

if TYPE_CHECKING:
    from robotd_tool_space.collision.scene_object import SceneObject
    from robotd_tool_space.collision_guard import CollisionGuard
    from robotd_tool_space.geometry.chain import Chain
    from robotd_tool_space.geometry.kinematics import Kinematics, Unreachable, UnreachableCause
    from robotd_tool_space.geometry.pose_solver import Task
    from robotd_tool_space.geometry.rotations import (
        inverse_pose,
        pose_differences,
        pose_of,
        quaternion_pose,
        rotation_matrices,
        rotation_vectors,
        rpy_of,
    )
    from robotd_tool_space.link_speeds import reduced_speed
    from robotd_tool_space.paths.path_outputs import PathOutput
    from robotd_tool_space.paths.segments import (
        Arc,
        ArcAbout,
        JointMove,
        Line,
        MotionSegment,
        Spline,
        Wait,
    )
    from robotd_tool_space.robot_tool import RobotTool
    from robotd_tool_space.tool_groups import ToolGroups
else:  # commands that read a robot's file need the keys of the feature only
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Arc",
    "ArcAbout",
    "Chain",
    "CollisionGuard",
    "JointMove",
    "Kinematics",
    "Line",
    "MotionSegment",
    "PathOutput",
    "RobotTool",
    "SceneObject",
    "Spline",
    "Task",
    "ToolGroups",
    "Unreachable",
    "UnreachableCause",
    "Wait",
    "inverse_pose",
    "pose_differences",
    "pose_of",
    "quaternion_pose",
    "reduced_speed",
    "rotation_matrices",
    "rotation_vectors",
    "rpy_of",
]
