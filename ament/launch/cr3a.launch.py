"""The CR3A with all its nodes in one process."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """One robotd; its first signal is the orderly stop, which a second one would cut short."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "variant",
                default_value="intel",
                choices=["intel", "orin"],
                description="Deployment: with Gazebo or with Isaac Sim beside it.",
            ),
            DeclareLaunchArgument("backend", default_value="sim", description="What drives it."),
            DeclareLaunchArgument(
                "namespace", default_value="", description="Of all nodes and relative names."
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                choices=["true", "false"],
                description="Take the stamps from /clock.",
            ),
            Node(
                package="robotd",
                executable="robotd",
                namespace=LaunchConfiguration("namespace"),
                arguments=[
                    "--robot",
                    "cr3a",
                    "--variant",
                    LaunchConfiguration("variant"),
                    "--backend",
                    LaunchConfiguration("backend"),
                ],
                parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
                output="screen",
                sigterm_timeout="20",
            ),
        ]
    )
