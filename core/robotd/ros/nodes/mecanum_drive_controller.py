"""mecanum_drive_controller: a mobile base with four mecanum wheels."""

from __future__ import annotations

from robotd.node_settings.mecanum_settings import read_mecanum_drive
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.base_controller import BaseController

NAME = "mecanum_drive_controller"


class MecanumDriveController(BaseController):
    """Node of a mecanum base; raises as ``BaseController``."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, robot, host, read_mecanum_drive)
