"""Pose of the tool from the process image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from structlog.testing import capture_logs

from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.descriptor.urdf import read_urdf
from robotd.device.process_image import ProcessImage
from robotd.device.tool_pose import ToolPose


@pytest.fixture
def cr3a() -> RobotDescriptor:
    return load_robot_descriptor("cr3a")


def test_the_link_of_the_last_joint_by_its_axes(cr3a: RobotDescriptor) -> None:
    joints = tuple(
        joint.model_copy(update={"axis": 5 - joint.axis}) for joint in cr3a.joints
    )  # the axes in reverse
    image = ProcessImage(6)
    tool = ToolPose.of_robot(cr3a.model_copy(update={"joints": joints}), image)
    assert tool is not None
    assert (tool.base, tool.link) == ("base_link", "link6")
    assert tool.frame() is None, "positions are not known before the first period"
    image.position[:] = [0.6, 0.5, 0.4, 0.3, 0.2, 0.1]
    positions = {f"joint{number}": number / 10 for number in range(1, 7)}
    assert cr3a.urdf is not None
    assert tool.frame() == pytest.approx(read_urdf(cr3a.urdf).pose("link6", positions))
    image.position[3] = np.nan
    assert tool.frame() is None


def test_another_link_is_named_by_the_descriptor(cr3a: RobotDescriptor) -> None:
    named = cr3a.model_copy(update={"tool_link": "link2"})
    tool = ToolPose.of_robot(named, ProcessImage(6))
    assert tool is not None
    assert tool.link == "link2"


@pytest.mark.parametrize("change", [{"urdf": None}, {"joints": ()}])
def test_without_joints_or_urdf_there_is_none(
    cr3a: RobotDescriptor, change: dict[str, Any]
) -> None:
    with capture_logs() as logs:
        assert ToolPose.of_robot(cr3a.model_copy(update=change), ProcessImage(6)) is None
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
        assert ToolPose.of_robot(cr3a.model_copy(update=change), ProcessImage(6)) is None
    assert [log["event"] for log in logs] == ["no pose of the tool"]
    assert reason in logs[0]["reason"]
