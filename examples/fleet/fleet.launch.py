"""Several robots, each in a process and a namespace of its own: robot1, robot2 and so on.

ros2 launch examples/fleet/fleet.launch.py robots:=8 robot:=baymax
"""

from typing import Any

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch_ros.actions import Node

STOP_S = "20"  # for the orderly stop


def start_robots(context: Any) -> list[Node]:
    """Return the processes; the number is known when launch runs."""
    chosen = context.launch_configurations
    return [
        Node(
            package="robotd",
            executable="robotd",
            namespace=f"robot{number}",
            arguments=["--robot", chosen["robot"], "--backend", chosen["backend"]],
            output="screen",
            sigterm_timeout=STOP_S,
        )
        for number in range(1, int(chosen["robots"]) + 1)
    ]


def generate_launch_description() -> LaunchDescription:
    """Called by launch."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("robots", default_value="4", description="How many."),
            DeclareLaunchArgument("robot", default_value="cr3a", description="Which robot."),
            DeclareLaunchArgument("backend", default_value="sim", description="Of all robots."),
            OpaqueFunction(function=start_robots),
        ]
    )
