"""Goals of ``move_tool`` that are canceled before they move."""

from __future__ import annotations

from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest

from robotd import open_robot
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd_tool_space import ToolGroups
from robotd_tool_space.geometry.rotations import fill_pose

pytest.importorskip("rclpy", reason="no ROS in this environment")

from geometry_msgs.msg import Pose
from robotd_msgs.action import MoveTool

from robotd_tool_space.nodes.tool_services import MoveToolAction

BENT = [0.0, 0.3, 1.4, -0.2, 1.2, 0.0]


def test_a_goal_that_is_canceled_while_it_is_planned_moves_nothing() -> None:
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        tool = robot.feature(ToolGroups).only
        goal, result = MoveTool.Goal(poses=[Pose()]), MoveTool.Result()
        fill_pose(goal.poses[0], tool.kinematics.forward(np.array(BENT)))
        handle = SimpleNamespace(request=goal, is_cancel_requested=True)
        action, start = MoveToolAction.__new__(MoveToolAction), robot.image.position_command.copy()
        with ExitStack() as after:
            outcome, text = action.execute(handle, result, after, tool, tool.arrive())
        robot.step(50)
        assert (outcome, result.success) == (Outcome.CANCELED, False)
        assert text == result.message == "canceled while it was planned; nothing moved"
        assert (robot.image.position_command == start).all()
