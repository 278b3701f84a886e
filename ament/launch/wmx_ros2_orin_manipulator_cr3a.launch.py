"""The CR3A on NVIDIA Jetson: the nodes of the vendor's launch file of this name, in one process."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).parents[1] / "config" / "orin_manipulator_config_cr3a.yaml"
NODES = [
    "manipulator_state",
    "follow_joint_trajectory_server",
    "wmx_engine_node",
    "wmx_core_motion_node",
    "wmx_io_node",
]


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
                executable="robotd",
                arguments=[
                    "--robot",
                    "cr3a",
                    "--variant",
                    "orin",
                    "--backend",
                    LaunchConfiguration("backend"),
                    "--nodes",
                    ",".join(NODES),
                ],
                parameters=[
                    str(CONFIG),
                    {"use_sim_time": LaunchConfiguration("use_sim_time")},
                ],
                output="screen",
                sigterm_timeout="20",
            ),
        ]
    )
