"""diff_drive_controller: a mobile base, from twists to wheels and from wheels to odometry."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from robotd.errors import DescriptorError, RobotdError
from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.middleware import TypeMismatchCheck
from robotd.ros.nodes.drive_parameters import drive_settings
from robotd.ros.nodes.node_parameters import Parameters
from robotd.ros.nodes.odometry_topics import OdometryFrames, OdometryTopics
from robotd.ros.nodes.rejection_log import RejectionLog
from robotd.ros.nodes.robot_description import publish_description
from robotd.ros.services import add_service, add_subscription

NAME = "diff_drive_controller"
COMMAND_DEPTH = 1  # only the newest twist means anything
ECHO_DEPTH = 10
RATE_HZ = 10

# Wheels measure x, y and yaw; sideways they do not slip; of the rest they know nothing.
NOT_MEASURED = 1e6
POSE_VARIANCES = (1e-3, 1e-3, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, 1e-2)
TWIST_VARIANCES = (1e-3, 1e-3, NOT_MEASURED, NOT_MEASURED, NOT_MEASURED, 1e-2)


class DiffDriveController(Node):
    """Node of a mobile base: twists in, odometry out; ``MobileBase`` does the control.

    With this node in the set, the wheels are switched on at start.

    Raises:
        DescriptorError: the robot has no base, or a parameter is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        drive = robot.descriptor.drive
        if robot.base is None or drive is None:
            raise DescriptorError(f"{NAME} needs a drive, which {robot.descriptor.name} has not")
        self._base = robot.base
        self._rejections = RejectionLog()
        parameters = Parameters(self, robot.descriptor)
        self._base.configure(drive_settings(parameters, drive))
        if path := parameters.file("wmx_param_file_path", "parameter file; empty: the robot's"):
            robot.connection.parameters.path = path
        self._take_commands(host, parameters)
        self._publish_state(parameters, robot)
        publish_description(self, robot, parameters)
        parameters.done()
        add_service(self, host, Trigger, "~/reset_odometry", self._reset_odometry, blocking=False)

    def _take_commands(self, host: RosHost, parameters: Parameters) -> None:
        stamped = parameters.flag("use_stamped_vel", False, "take TwistStamped instead of Twist")
        topic = parameters.topic("cmd_vel_topic", "commands", required=True)
        echo = parameters.topic("encoder_vel_topic", "echo of the commands", required=True)
        self._topic = topic
        self._echo = self.create_publisher(Twist, echo, ECHO_DEPTH)
        if stamped:
            taken, handler = TwistStamped, lambda message: self._command(message.twist)
        else:
            taken, handler = Twist, self._command
        subscription = add_subscription(self, host, taken, topic, handler, COMMAND_DEPTH)
        self._offered = TypeMismatchCheck(
            self,
            subscription,
            f"geometry_msgs/msg/{taken.__name__}",
            f"publish {taken.__name__}, or set use_stamped_vel to {str(not stamped).lower()}",
        )

    def _publish_state(self, parameters: Parameters, robot: Robot) -> None:
        frames = OdometryFrames(
            parameters.text("odom_frame_id", "odom", "fixed frame of the odometry"),
            parameters.text("base_frame_id", "base_link", "frame of the base"),
            self._variances(parameters, "pose_covariance_diagonal", POSE_VARIANCES),
            self._variances(parameters, "twist_covariance_diagonal", TWIST_VARIANCES),
        )
        highest = int(robot.descriptor.cycle.rate_hz)
        rate_hz = parameters.integer("rate", RATE_HZ, (1, highest), "rate of the topics in Hz")
        topics = OdometryTopics(
            self,
            robot,
            frames,
            parameters.topic("encoder_omega_topic", "speeds of the wheels", required=True),
            parameters.topic("encoder_odometry_topic", "odometry", required=True),
            publish_tf=parameters.flag("publish_tf", False, "publish odom → base on tf"),
        )
        robot.control_loop.every(rate_hz, "odometry", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(rate_hz))

    def _variances(
        self, parameters: Parameters, name: str, default: tuple[float, ...]
    ) -> tuple[float, ...]:
        values = parameters.numbers(name, default, "variances of x, y, z, roll, pitch, yaw")
        if min(values) < 0.0:
            raise parameters.error(name, f"{min(values)} is below 0")
        return values

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
