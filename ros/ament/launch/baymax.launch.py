"""Baymax with all its nodes in one process."""

import sys
from pathlib import Path

from launch import LaunchDescription

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import robot_process


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return robot_process("baymax", namespace=True)
