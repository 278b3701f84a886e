"""The CR3A on x86 computers: the nodes of the vendor's launch file of this name, in one process."""

import sys
from pathlib import Path

from launch import LaunchDescription

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import ARM_NODES, SERVICE_NODES, robot_process


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return robot_process(
        "cr3a",
        variant="intel",
        nodes=(*ARM_NODES, *SERVICE_NODES[:-1]),
        config="intel_manipulator_config_cr3a.yaml",
    )
