"""Robot descriptors made from a URDF."""

from robotd_new_robot.joint_roles import Choices
from robotd_new_robot.robot_files import bus_robot_files, robot_files
from robotd_new_robot.robot_plan import RobotPlan, plan_robot, plan_rows

__all__ = ["Choices", "RobotPlan", "bus_robot_files", "plan_robot", "plan_rows", "robot_files"]
