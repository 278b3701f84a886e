"""An engine that stands still for a time, in the midst of a streamed path."""

from __future__ import annotations

import time
from pathlib import Path

from robotd.device.state import Operation
from robots import eventually, goal, running
from standin_port import port

CRUISE_RAD_S = 0.24  # of a travel of 2 rad in 8 s
FROZEN_S = 1.0
MOST_OF_THE_PAST_RAD = 0.12  # 66 ms at 0.3 rad/s and a ramp are 0.03; all that came is 0.3


def test_an_engine_that_stood_still_executes_little_of_the_past(tmp_path: Path) -> None:
    """It executes what its buffers held at the stall, not what arrived meanwhile."""
    with running(tmp_path) as robot, robot.follower.follow(goal([8.0], 2.0)):
        eventually(lambda: robot.image.velocity_command[0] > CRUISE_RAD_S)
        port("freeze", 1)
        time.sleep(FROZEN_S)
        before = robot.image.position_command.copy()
        robot.axes._driver.stop(range(len(before)))
        port("freeze", 0)
        eventually(lambda: robot.image.position_command[0] > before[0])
        eventually(lambda: bool((robot.image.operation == Operation.IDLE).all()))
        displacement = robot.image.position_command - before
    assert displacement.max() < MOST_OF_THE_PAST_RAD
