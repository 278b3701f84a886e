"""The four service nodes of the vendor's launch file of this name, in one process."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

NODES = ["wmx_engine_node", "wmx_core_motion_node", "wmx_io_node", "wmx_ethercat_node"]


def generate_launch_description() -> LaunchDescription:
    """One robotd; its first signal is the orderly stop, which a second one would cut short."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "robot", default_value="standalone", description="Robot that has the axes."
            ),
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
                    LaunchConfiguration("robot"),
                    "--backend",
                    LaunchConfiguration("backend"),
                    "--nodes",
                    ",".join(NODES),
                ],
                parameters=[{"use_sim_time": LaunchConfiguration("use_sim_time")}],
                output="screen",
                sigterm_timeout="20",
            ),
        ]
    )
