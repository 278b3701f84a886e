"""robotd robots for LeRobot: ``--robot.type=robotd --robot.descriptor=cr3a``.

LeRobot imports each installed distribution whose name begins with ``lerobot_robot_``, and finds the
class of a robot by that of its configuration, without ``Config``.
"""

from lerobot_robot_robotd.config_robotd_robot import RobotdRobotConfig
from lerobot_robot_robotd.robotd_robot import RobotdRobot
from lerobot_robot_robotd.world_camera import WorldCameraConfig

__all__ = ["RobotdRobot", "RobotdRobotConfig", "WorldCameraConfig"]
