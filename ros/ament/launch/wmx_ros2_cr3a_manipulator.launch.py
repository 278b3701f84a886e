"""The CR3A: what the vendor's launch file of this name starts, in one process."""

import sys
from pathlib import Path

from launch import LaunchDescription

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import ARM_NODES, SERVICE_NODES, robot_process


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return robot_process(
        "cr3a", nodes=(*ARM_NODES, *SERVICE_NODES), config="cr3a_manipulator_config.yaml"
    )
