"""manipulator_state: joint states at the feedback rate, republished for simulators."""

from __future__ import annotations

from rclpy.node import Node

from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.joint_state_topics import Fingers, JointStateTopics
from robotd.ros.nodes.node_parameters import Parameters
from robotd.ros.nodes.robot_description import publish_description

NAME = "manipulator_state"


class ManipulatorState(Node):
    """Node that publishes arm joints and gripper fingers from the control loop.

    With this node in the set, the robot's joints are switched on at start.

    Raises:
        DescriptorError: a parameter is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        self._robot = robot
        parameters = Parameters(self, robot.descriptor)
        declare_joints(parameters, robot)
        names = (*robot.joint_names, *(robot.gripper.joints if robot.gripper else ()))
        parameters.same_as("joints", "joint_name", names, "names of the joints, then the fingers")
        highest = int(robot.descriptor.cycle.rate_hz)
        rate_hz = parameters.integer(
            "joint_feedback_rate", highest, (1, highest), "rate of the joint topics in Hz"
        )
        topics = JointStateTopics(self, robot, names, self._fingers(parameters))
        topics.add_joint_states(
            parameters.topic("encoder_joint_topic", "topic of the joint states", required=True)
        )
        if topic := parameters.topic("isaacsim_joint_topic", "copy without time stamp"):
            topics.add_unstamped(topic)
        if topic := parameters.topic("gazebo_joint_topic", "positions as a bare array"):
            topics.add_positions(topic)
        if path := parameters.file("wmx_param_file_path", "parameter file; empty: the robot's"):
            robot.connection.parameters.path = path
        publish_description(self, robot, parameters)
        parameters.done()
        robot.control_loop.every(rate_hz, "joint states", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(rate_hz))

    def _fingers(self, parameters: Parameters) -> Fingers | None:
        settings, gripper = self._robot.descriptor.gripper, self._robot.gripper
        open_m = parameters.number(
            "gripper_open_value", settings.open_m if settings else 0.0, "open fingers, in m"
        )
        closed_m = parameters.number(
            "gripper_close_value", settings.closed_m if settings else 0.0, "closed fingers, in m"
        )
        return Fingers(gripper, open_m, closed_m) if gripper else None


def declare_joints(parameters: Parameters, robot: Robot) -> None:
    """Declare ``joint_number`` and ``joint_units``, for clients to read.

    Raises DescriptorError: the robot has no joint, or a parameter contradicts the descriptor.
    """
    if not robot.joint_names:
        raise parameters.error("joint_number", f"{robot.descriptor.name} has no joints")
    parameters.same_as("joints", "joint_number", len(robot.joint_names), "number of joints")
    units = [joint.unit for joint in robot.descriptor.joints]
    parameters.same_as("joints", "joint_units", units, "rad or m for each joint")
