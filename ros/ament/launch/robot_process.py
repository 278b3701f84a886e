"""Launch description of one robotd process; every launch file here is a call of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).parents[1] / "config"
SERVICE_NODES = ("wmx_engine_node", "wmx_core_motion_node", "wmx_io_node", "wmx_ethercat_node")
ARM_NODES = ("manipulator_state", "follow_joint_trajectory_server")
STOP_S = "20"  # the first signal is the orderly stop, which a second one would cut short


def robot_process(
    robot: str | DeclareLaunchArgument,
    *,
    variant: str | DeclareLaunchArgument | None = None,
    nodes: Sequence[str] = (),
    config: str | None = None,
    namespace: bool = False,
) -> LaunchDescription:
    """Describe a process with the arguments ``backend`` and ``use_sim_time``.

    Args:
        robot, variant: a value, or an argument of the launch file; variant None: the robot's own.
        nodes: nodes to start; empty: all of the robot.
        config: name of a parameter file of ``config/``; None: no file.
        namespace: whether the launch file has the argument ``namespace``.
    """
    backend = DeclareLaunchArgument(
        "backend", default_value="sim", description="Backend plugin that drives the robot."
    )
    use_sim_time = DeclareLaunchArgument(
        "use_sim_time",
        default_value="false",
        choices=["true", "false", "True", "False"],  # as Python and as YAML write them
        description="Take the stamps from /clock.",
    )
    arguments = {"--robot": robot, "--backend": backend}
    if variant is not None:
        arguments["--variant"] = variant
    if nodes:
        arguments["--nodes"] = ",".join(nodes)
    declared = [value for value in arguments.values() if isinstance(value, DeclareLaunchArgument)]
    options = {}
    if namespace:
        own = DeclareLaunchArgument(
            "namespace", default_value="", description="Of all nodes and relative names."
        )
        declared.append(own)
        options["namespace"] = LaunchConfiguration(own.name)
    process = Node(
        package="robotd",
        executable="robotd",
        arguments=[word for name, value in arguments.items() for word in (name, _word(value))],
        parameters=[
            *([] if config is None else [str(CONFIG / config)]),
            {"use_sim_time": LaunchConfiguration("use_sim_time")},
        ],
        output="screen",
        sigterm_timeout=STOP_S,
        **options,
    )
    return LaunchDescription([*declared, use_sim_time, process])


def service_nodes() -> LaunchDescription:
    """Describe a process of ``SERVICE_NODES`` with the argument ``robot``."""
    robot = DeclareLaunchArgument(
        "robot", default_value="standalone", description="Robot that has the axes."
    )
    return robot_process(robot, nodes=SERVICE_NODES)


def _word(value: str | DeclareLaunchArgument) -> str | LaunchConfiguration:
    return value if isinstance(value, str) else LaunchConfiguration(value.name)
