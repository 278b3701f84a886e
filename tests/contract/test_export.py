"""Contract of the exports for clients: they agree with the interfaces of the nodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from tests.contract.surfaces import surface

from robotd.cli.start_summary import ServeReport
from robotd.robot import Robot, build_robot
from robotd_export.export_command import export_function, export_targets
from robotd_export.export_input import ExportInput
from robotd_export.nav2 import twist_limits

EXPORTS = {target: export_function(target) for target in export_targets()}


@pytest.fixture(scope="module")
def arm() -> tuple[Robot, ServeReport]:
    robot = build_robot("cr3a", "sim", "orin")
    return robot, surface(robot, "-r", "__ns:=/left")


@pytest.fixture(scope="module")
def base() -> tuple[Robot, ServeReport]:
    robot = build_robot("baymax", "sim")
    return robot, surface(robot)


def topics(report: ServeReport) -> dict[str, str]:
    return {topic.name: topic.type for topic in report.topics}


def values(content: Any, *keys: str) -> Iterator[Any]:
    """The values of ``keys`` at any depth."""
    for key, value in content.items() if isinstance(content, dict) else enumerate(content):
        if key in keys:
            yield value
        if isinstance(value, dict | list):
            yield from values(value, *keys)


def test_moveit_is_led_to_the_actions(arm: tuple[Robot, ServeReport]) -> None:
    robot, report = arm
    exported = yaml.safe_load(EXPORTS["moveit"](ExportInput(robot.descriptor, "/left")))
    manager = exported["/**"]["ros__parameters"]["moveit_simple_controller_manager"]
    actions = {f"/{name}/{manager[name]['action_ns']}" for name in manager["controller_names"]}
    assert len(actions) == 2
    assert actions <= set(report.actions)


def test_isaac_is_led_to_topics_of_its_types(
    arm: tuple[Robot, ServeReport], base: tuple[Robot, ServeReport]
) -> None:
    for (robot, report), namespace in ((arm, "/left"), (base, "/")):
        source = ExportInput(robot.descriptor, namespace)
        first, _clock = yaml.safe_load(EXPORTS["isaac"](source))["action_graph"]
        assert topics(report)[first["topic"]] == first["type"]


def test_nav2_is_led_to_topics_of_its_types(base: tuple[Robot, ServeReport]) -> None:
    robot, report = base
    content = yaml.safe_load(EXPORTS["nav2"](ExportInput(robot.descriptor)))
    found = topics(report)
    assert {found[name] for name in values(content, "odom_topic")} == {"nav_msgs/msg/Odometry"}
    assert {found[name] for name in values(content, "cmd_vel_out_topic")} == {
        "geometry_msgs/msg/Twist"
    }


def test_nav2_has_the_limits_that_the_base_keeps(base: tuple[Robot, ServeReport]) -> None:
    robot, _ = base
    assert robot.base is not None
    kept = robot.base.settings
    assert twist_limits(ExportInput(robot.descriptor)) == {
        "max_velocity": [kept.velocity_m_s, 0.0, kept.angular_velocity_rad_s],
        "min_velocity": [-kept.velocity_m_s, 0.0, -kept.angular_velocity_rad_s],
        "max_accel": [kept.acceleration_m_s2, 0.0, kept.angular_acceleration_rad_s2],
        "max_decel": [-kept.deceleration_m_s2, 0.0, -kept.angular_deceleration_rad_s2],
    }
