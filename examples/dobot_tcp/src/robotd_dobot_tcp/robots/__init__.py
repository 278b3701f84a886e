"""The robot dobot_cr3a: its folder is beside this file."""

from pathlib import Path

from robotd.api import RobotRegistry, hookimpl


@hookimpl
def robotd_register_robots(registry: RobotRegistry) -> None:
    """Let ``robotd --robot dobot_cr3a`` find it."""
    registry.add_folder(Path(__file__).parent)
