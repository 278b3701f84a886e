"""Baymax: the node of the vendor's launch file of this name."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).parents[1] / "config" / "diff_drive_controller_config.yaml"


def generate_launch_description() -> LaunchDescription:
    """One robotd; its first signal is the orderly stop, which a second one would cut short."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("backend", default_value="sim", description="What drives it."),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                choices=["true", "false"],
                description="Take the stamps from /clock.",
            ),
            Node(
                package="robotd",
                executable="diff_drive_controller",
                arguments=["--backend", LaunchConfiguration("backend")],
                parameters=[
                    str(CONFIG),
                    {"use_sim_time": LaunchConfiguration("use_sim_time")},
                ],
                output="screen",
                sigterm_timeout="20",
            ),
        ]
    )
