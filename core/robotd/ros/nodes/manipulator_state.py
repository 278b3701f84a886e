"""manipulator_state: the joints' state at the feedback rate, and the mirrors for simulators."""

from __future__ import annotations

from rclpy.node import Node

from robotd.robot import Robot
from robotd.ros.host import RosHost
from robotd.ros.nodes.joint_state_topics import Fingers, JointStateTopics
from robotd.ros.nodes.node_parameters import Parameters
from robotd.ros.nodes.robot_description import publish_description

NAME = "manipulator_state"


class ManipulatorState(Node):
    """Publishes arm joints and gripper fingers from the cycle.

    With this node in the set, the robot's joints are switched on at start.

    Raises:
        DescriptorError: a parameter is wrong; nothing was opened.
    """

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        self._robot = robot
        parameters = Parameters(self, robot.descriptor.ros_parameters.get(NAME, {}))
        joint_count(parameters, robot)
        names = self._joint_names(parameters)
        highest = int(robot.descriptor.cycle.rate_hz)
        rate_hz = parameters.integer(
            "joint_feedback_rate", 0, (1, highest), "rate of the joint topics in Hz"
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
            robot.connection.parameters_file = path
        publish_description(self, robot, parameters)
        parameters.done()
        robot.control_loop.every(rate_hz, "joint states", topics.publish)
        self.rates_hz = dict.fromkeys(topics.topics, float(rate_hz))

    def _joint_names(self, parameters: Parameters) -> tuple[str, ...]:
        joints = self._robot.joint_names
        fingers = self._robot.gripper.joints if self._robot.gripper else ()
        reference = tuple(f"j{number}" for number in range(1, 7))
        names = parameters.texts("joint_name", reference, "names of the joints, then the fingers")
        if len(names) != len(joints) + len(fingers):
            raise parameters.error(
                "joint_name",
                f"{len(names)} names for {len(joints)} joints and {len(fingers)} fingers",
            )
        for place, name in enumerate(names):
            if name in names[:place] or not name:
                raise parameters.error("joint_name", f"{name!r} is empty or given twice")
            if name in joints and joints.index(name) != place:
                what = f"{name!r} is joint {joints.index(name) + 1} of the robot, not {place + 1}"
                raise parameters.error("joint_name", what)
        return names

    def _fingers(self, parameters: Parameters) -> Fingers | None:
        settings, gripper = self._robot.descriptor.gripper, self._robot.gripper
        open_m = parameters.number(
            "gripper_open_value", settings.open_m if settings else 0.0, "open fingers, in m"
        )
        closed_m = parameters.number(
            "gripper_close_value", settings.closed_m if settings else 0.0, "closed fingers, in m"
        )
        return Fingers(gripper, open_m, closed_m) if gripper else None


def joint_count(parameters: Parameters, robot: Robot) -> int:
    """Declare ``joint_number``, which must be the number of joints of the robot."""
    count = len(robot.joint_names)
    number = parameters.integer("joint_number", 0, (0, 128), "number of joints")
    if number != count or count == 0:
        what = f"{number} joints, but {robot.descriptor.name} has {count}"
        raise parameters.error("joint_number", what)
    return number
