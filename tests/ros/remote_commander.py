"""Process that commands a robot over the network, as its lines on stdin say.

    python -m tests.ros.remote_commander publish KIND    # of COMMANDS
    python -m tests.ros.remote_commander watch

``publish`` takes "go", "halt" and "probe". ``watch`` prints position and velocity of axis 0, and
"probe" for each probe: the link carries messages.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from control_msgs.msg import JointJog
from geometry_msgs.msg import Twist
from rclpy.node import Node
from std_msgs.msg import Empty, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wmx_ros2_message.msg import AxisPose, AxisState, AxisVelocity

PERIOD_S = 0.02
SPEED = 0.2  # rad/s or m/s
PROBE = "/probe"
OWN_TOPICS = ("/rosout", "/parameter_events")
MATCH_TIMEOUT_S = 30.0


def position(node: Node) -> Callable[[float], None]:
    publisher = node.create_publisher(
        Float64MultiArray, "/forward_position_controller/commands", 10
    )
    return lambda seconds: publisher.publish(
        Float64MultiArray(data=[SPEED * seconds, 0.0, 0.0, 0.0, 0.0, 0.0])
    )


def axis_jog(node: Node) -> Callable[[float], None]:
    publisher = node.create_publisher(AxisVelocity, "/wmx/axis/jog", 10)
    return lambda _: publisher.publish(
        AxisVelocity(index=[0], velocity=[SPEED], acc=[5.0], dec=[5.0])
    )


def joint_jog(node: Node) -> Callable[[float], None]:
    publisher = node.create_publisher(JointJog, "/servo_node/delta_joint_cmds", 10)

    def publish(_: float) -> None:
        message = JointJog(joint_names=["joint1"], velocities=[SPEED])
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    return publish


def twist(node: Node) -> Callable[[float], None]:
    publisher = node.create_publisher(Twist, "/cmd_vel", 10)
    message = Twist()
    message.linear.x = SPEED
    return lambda _: publisher.publish(message)


def points(node: Node) -> Callable[[float], None]:
    topic = "/movensys_manipulator_arm_controller/joint_trajectory"
    publisher = node.create_publisher(JointTrajectory, topic, 10)
    return lambda seconds: publisher.publish(
        JointTrajectory(
            joint_names=["joint1"], points=[JointTrajectoryPoint(positions=[SPEED * seconds])]
        )
    )


def moves(node: Node) -> Callable[[float], None]:
    publisher = node.create_publisher(AxisPose, "/wmx/axis/position/relative", 10)
    step = [PERIOD_S * SPEED]
    message = AxisPose(index=[0], target=step, velocity=[SPEED], acc=[5.0], dec=[5.0])
    return lambda _: publisher.publish(message)


COMMANDS = {
    "position": position,
    "points": points,
    "stamped_jog": joint_jog,
    "jog": axis_jog,
    "moves": moves,
    "twist": twist,
}


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def wait_for_robot(node: Node) -> None:
    """Wait until the robot is found: it takes a first message that it missed for a later one."""
    deadline_s = time.monotonic() + MATCH_TIMEOUT_S
    commands = [
        publisher for publisher in node.publishers if publisher.topic_name not in OWN_TOPICS
    ]
    while time.monotonic() < deadline_s:
        if all(publisher.get_subscription_count() for publisher in commands):
            return
        time.sleep(0.02)


def publish(node: Node, kind: str) -> None:
    command = COMMANDS[kind](node)
    wait_for_robot(node)
    probe = node.create_publisher(Empty, PROBE, 10)
    going = threading.Event()

    def run() -> None:
        sent = 0
        while going.wait():
            sent += 1
            command(sent * PERIOD_S)
            time.sleep(PERIOD_S)

    threading.Thread(target=run, daemon=True).start()
    say("ready")
    for line in sys.stdin:
        match line.strip():
            case "go":
                going.set()
            case "halt":
                going.clear()
            case "probe":
                probe.publish(Empty())


def watch(node: Node) -> None:
    def print_axis(message: Any) -> None:
        say(f"{message.actual_pos[0]} {message.actual_velocity[0]}")

    node.create_subscription(AxisState, "/wmx/axis/state", print_axis, 10)
    node.create_subscription(Empty, PROBE, lambda _: say("probe"), 10)
    rclpy.spin(node)


if __name__ == "__main__":
    rclpy.init()
    made = rclpy.create_node(f"remote_{sys.argv[1]}")
    if sys.argv[1] == "watch":
        watch(made)
    else:
        publish(made, sys.argv[2])
