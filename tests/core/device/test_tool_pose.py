"""Poses of the tools from the process image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from structlog.testing import capture_logs

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.descriptor.urdf import read_urdf
from robotd.device.process_image import ProcessImage
from robotd.device.tool_pose import tool_poses


@pytest.fixture
def cr3a() -> RobotDescriptor:
    return load_robot_descriptor("cr3a")


def test_the_link_of_the_last_joint_by_its_axes(cr3a: RobotDescriptor) -> None:
    joints = tuple(
        joint.model_copy(update={"axis": 5 - joint.axis}) for joint in cr3a.joints
    )  # the axes in reverse
    image = ProcessImage(6)
    (tool,) = tool_poses(cr3a.model_copy(update={"joints": joints}))
    assert (tool.base, tool.link) == ("base_link", "link6")
    assert tool.frame(image) is None, "positions are not known before the first period"
    image.position[:] = [0.6, 0.5, 0.4, 0.3, 0.2, 0.1]
    positions = {f"joint{number}": number / 10 for number in range(1, 7)}
    assert cr3a.urdf is not None
    assert tool.frame(image) == pytest.approx(read_urdf(cr3a.urdf).pose("link6", positions))
    image.position[3] = np.nan
    assert tool.frame(image) is None


def test_another_link_is_named_by_the_descriptor(cr3a: RobotDescriptor) -> None:
    (tool,) = tool_poses(cr3a.model_copy(update={"tool_link": "link2"}))
    assert tool.link == "link2"


def test_each_group_has_a_tool() -> None:
    dual = load_robot_descriptor("dual_cr3a")
    assert [tool.link for tool in tool_poses(dual)] == ["left_link6", "right_link6"]
    groups = dict(dual.groups)
    groups["left"] = groups["left"].model_copy(update={"tool_link": "left_link3"})
    named = dual.model_copy(update={"groups": groups})
    left, right = tool_poses(named)
    assert (left.link, right.link) == ("left_link3", "right_link6")
    image = ProcessImage(12)
    image.position[:] = 0.1
    before = right.frame(image)
    image.position[:6] = 0.5
    assert right.frame(image) == pytest.approx(before), "the other arm does not matter"


@pytest.mark.parametrize("change", [{"urdf": None}, {"joints": ()}])
def test_without_joints_or_urdf_there_is_none(
    cr3a: RobotDescriptor, change: dict[str, Any]
) -> None:
    with capture_logs() as logs:
        assert tool_poses(cr3a.model_copy(update=change)) == ()
    assert logs == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"tool_link": "gripper"}, "has no link 'gripper'"),
        ({"urdf": Path("/nowhere.urdf")}, "/nowhere.urdf"),
    ],
)
def test_a_urdf_that_cannot_be_used_is_logged(
    cr3a: RobotDescriptor, change: dict[str, Any], reason: str
) -> None:
    with capture_logs() as logs:
        assert tool_poses(cr3a.model_copy(update=change)) == ()
    assert [log["event"] for log in logs] == ["no pose of the tool"]
    assert reason in logs[0]["reason"]
