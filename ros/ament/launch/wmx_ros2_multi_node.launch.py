"""The four service nodes of the vendor's launch file of this name, in one process."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import SERVICE_NODES, robot_process


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return robot_process(
        DeclareLaunchArgument(
            "robot", default_value="standalone", description="Robot that has the axes."
        ),
        nodes=SERVICE_NODES,
    )
