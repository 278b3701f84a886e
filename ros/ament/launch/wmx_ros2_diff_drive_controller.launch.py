"""Baymax: the node of the vendor's launch file of this name."""

import sys
from pathlib import Path

from launch import LaunchDescription

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import robot_process


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return robot_process(
        "baymax",
        nodes=("diff_drive_controller",),
        config="diff_drive_controller_config.yaml",
    )
