"""diff_drive_controller: a mobile base with two driven wheels."""

from __future__ import annotations

from robotd.node_settings.base_settings import read_diff_drive
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.base_controller import BaseController

NAME = "diff_drive_controller"


class DiffDriveController(BaseController):
    """Node of a differential base; raises as ``BaseController``."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, robot, host, read_diff_drive)
