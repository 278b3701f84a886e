"""tricycle_controller: a mobile base with a steered wheel."""

from __future__ import annotations

from robotd.node_settings.tricycle_settings import read_tricycle
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.base_controller import BaseController

NAME = "tricycle_controller"


class TricycleController(BaseController):
    """Node of a base with a steered wheel; raises as ``BaseController``."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, robot, host, read_tricycle)
