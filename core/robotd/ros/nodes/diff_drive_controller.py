"""diff_drive_controller: a mobile base, from twists to wheels and from wheels to odometry."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from robotd.errors import DescriptorError, RobotdError
from robotd.node_settings.base_settings import DiffDriveSettings, read_diff_drive
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.middleware import TypeMismatchCheck
from robotd.ros.nodes.node_parameters import Parameters
from robotd.ros.nodes.odometry_topics import OdometryFrames, OdometryTopics
from robotd.ros.nodes.rejection_log import RejectionLog
from robotd.ros.nodes.robot_description import publish_description
from robotd.ros.services import add_service, add_subscription

NAME = "diff_drive_controller"
COMMAND_DEPTH = 1  # only the newest twist means anything
ECHO_DEPTH = 10


class DiffDriveController(Node):
    """Node of a mobile base: twists in, odometry out; ``MobileBase`` does the control.

    With this node in the set, the wheels are switched on at start.

    Raises:
        DescriptorError: the robot has no base, or a parameter is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        self._rejections = RejectionLog()
        if robot.base is None:
            raise DescriptorError(f"{NAME} needs a drive, which {robot.descriptor.name} has not")
        self._base = robot.base
        parameters = Parameters(self, robot.descriptor)
        settings = read_diff_drive(parameters, robot.descriptor)
        parameters.done()
        self._base.configure(settings.drive)
        if settings.parameters_file:
            robot.connection.parameters.path = settings.parameters_file
        self._take_commands(host, settings)
        self._publish_state(settings, robot)
        publish_description(self, settings.description)
        add_service(self, host, Trigger, "~/reset_odometry", self._reset_odometry, blocking=False)

    def _take_commands(self, host: RosHost, settings: DiffDriveSettings) -> None:
        self._topic = settings.commands
        self._echo = self.create_publisher(Twist, settings.echo, ECHO_DEPTH)
        if settings.stamped:
            taken, handler = TwistStamped, lambda message: self._command(message.twist)
        else:
            taken, handler = Twist, self._command
        subscription = add_subscription(self, host, taken, self._topic, handler, COMMAND_DEPTH)
        self._offered = TypeMismatchCheck(
            self,
            subscription,
            f"geometry_msgs/msg/{taken.__name__}",
            f"publish {taken.__name__}, or set use_stamped_vel to"
            f" {str(not settings.stamped).lower()}",
        )

    def _publish_state(self, settings: DiffDriveSettings, robot: Robot) -> None:
        topics = OdometryTopics(
            self,
            robot,
            OdometryFrames(
                settings.odom_frame,
                settings.base_frame,
                settings.pose_variances,
                settings.twist_variances,
            ),
            settings.wheel_speeds,
            settings.odometry,
            publish_tf=settings.publish_tf,
        )
        robot.control_loop.every(settings.rate_hz, "odometry", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(settings.rate_hz))

    def _command(self, twist: Any) -> None:
        try:
            self._base.command(twist.linear.x, twist.angular.z)
        except RobotdError as error:
            self._rejections.rejected(self._topic, (), str(error))
            return
        self._rejections.accepted(self._topic, ())
        self._echo.publish(twist)

    def _reset_odometry(self, request: Any, response: Any) -> Any:
        self._base.reset_odometry()
        response.success = True
        response.message = "odometry set to zero"
        return response
