"""The CR3A with all its nodes in one process."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import robot_process


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return robot_process(
        "cr3a",
        variant=DeclareLaunchArgument(
            "variant",
            default_value="intel",
            choices=["intel", "orin"],
            description="Deployment: with Gazebo or with Isaac Sim beside it.",
        ),
        namespace=True,
    )
