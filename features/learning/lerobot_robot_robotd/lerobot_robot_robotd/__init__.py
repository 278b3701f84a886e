"""robotd robots and leader arms for LeRobot: ``--robot.type=robotd``, ``--teleop.type=robotd``.

LeRobot imports each installed distribution whose name begins with ``lerobot_robot_``, and finds the
class of a robot, or of a teleoperator, by that of its configuration, without ``Config``.
"""

from lerobot_robot_robotd.config_robotd_robot import RobotdRobotConfig
from lerobot_robot_robotd.config_robotd_teleoperator import RobotdTeleoperatorConfig
from lerobot_robot_robotd.robotd_robot import RobotdRobot
from lerobot_robot_robotd.robotd_teleoperator import RobotdTeleoperator
from lerobot_robot_robotd.world_camera import WorldCameraConfig

__all__ = [
    "RobotdRobot",
    "RobotdRobotConfig",
    "RobotdTeleoperator",
    "RobotdTeleoperatorConfig",
    "WorldCameraConfig",
]
