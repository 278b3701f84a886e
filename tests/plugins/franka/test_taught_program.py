"""A program that was taught by hand, judged by the arm of the simulated controller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.plugins.franka.controller import controller, needs_simulator
from tests.plugins.franka.test_on_controller import arm
from tests.ros.robot_process import wait_until

from robotd import OperationError
from robotd_teach.hand_guiding import HandGuiding
from robotd_teach.poses import Poses
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

pytestmark = [needs_simulator, pytest.mark.long]

WAY = 0.2  # of joint1 by hand, rad
PUSH_NM, FAST, SLOW = 1.5, 0.15, 0.03  # of the hand; rad/s at which it lets go, and is at rest
TOLERANCE = 0.03
PROGRAM = Program.parse("""
speed: 0.2
steps:
  - repeat:
      times: 3
      steps:
        - move: {pose: there}
        - move: {pose: home}
""")


def test_a_program_of_poses_led_by_hand_is_run_stopped_and_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with controller() as unit, arm(tmp_path, unit.address) as robot:
        poses, programs = robot.feature(Poses), robot.feature(Programs)

        def push(torque_nm: float) -> float:
            """Push joint1 as long as the next call is away; return its true position."""
            return unit.command(push=[0, torque_nm]).position[0]

        def speed() -> float:
            return float(robot.image.copy().velocity[0])

        start = np.array(unit.command().position)
        poses.save("home")
        with robot.feature(HandGuiding).guided():
            try:
                wait_until(
                    lambda: push(PUSH_NM if speed() < FAST else 0.0) > start[0] + WAY,
                    "the hand leads the arm",
                )
                wait_until(
                    lambda: push(-PUSH_NM if speed() > SLOW else 0.0) and abs(speed()) < SLOW,
                    "the hand holds the arm",
                )
            finally:
                push(0.0)
            poses.save("there")
        there = poses.known("there")[robot.joint_names[0]]
        assert there > start[0] + WAY - TOLERANCE

        places: list[float] = []

        def stop_halfway() -> None:
            state = programs.state
            places.append(unit.command().position[0])
            if (state.executed, state.step) == (2, 1) and state.progress > 0.4:
                programs.stop("by the test")

        with pytest.raises(OperationError, match="stopped at step 1 of 2: by the test"):
            programs.run(PROGRAM, stop_halfway)
        between = unit.command().position[0]
        assert start[0] + TOLERANCE < between < there - TOLERANCE
        programs.resume(lambda: places.append(unit.command().position[0]))
        assert (programs.state.state, programs.state.executed) == ("done", 6)
        assert unit.command().position == pytest.approx(start, abs=TOLERANCE)
        assert min(places) > start[0] - TOLERANCE
        assert max(places) < there + TOLERANCE
