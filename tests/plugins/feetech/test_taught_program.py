"""A program that was taught by hand, judged by what the simulated servos do, in real time."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.plugins.feetech.test_on_servos import ANGLES, arrived, jumps, served, until
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo

from robotd import OperationError, Robot
from robotd_teach.hand_guiding import HandGuiding
from robotd_teach.poses import Poses
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

pytestmark = pytest.mark.long

WAY = 0.4  # of joint1 by hand, rad
STEP = 0.004  # of the hand, after the robot has seen the one before: below the bound of the speed
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


def seen(robot: Robot) -> float:
    """Return the measured position of joint1, rad."""
    return float(robot.image.copy().position[0])


def lead(robot: Robot, bus: StsBus) -> None:
    """Move joint1 by hand, which is let go."""
    start = ANGLES[1]
    for number in range(1, round(WAY / STEP) + 1):
        angle = start + number * STEP
        bus.arm[1].move(angle)
        until(lambda angle=angle: seen(robot) > angle - STEP, "the position follows the hand")


def test_a_program_of_poses_led_by_hand_is_run_stopped_and_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    servos = {number: Servo(angle=angle) for number, angle in ANGLES.items()}
    for servo in servos.values():
        servo.set("return_delay", 0)
    with StsBus(servos, seed=1) as bus, served(bus, tmp_path) as robot:
        poses, programs = robot.feature(Poses), robot.feature(Programs)
        poses.save("home")
        with robot.feature(HandGuiding).guided(held=True):
            lead(robot, bus)
            poses.save("there")
        assert poses.known("there")["joint1"] == pytest.approx(ANGLES[1] + WAY, abs=TOLERANCE)

        def stop_halfway() -> None:
            state = programs.state
            if (state.executed, state.step) == (2, 1) and state.progress > 0.4:
                programs.stop("by the test")

        with pytest.raises(OperationError, match="stopped at step 1 of 2: by the test"):
            programs.run(PROGRAM, stop_halfway)
        between = bus.arm[1].angle
        assert ANGLES[1] + TOLERANCE < between < ANGLES[1] + WAY - TOLERANCE
        programs.resume()
        assert (programs.state.state, programs.state.executed) == ("done", 6)
        until(lambda: arrived(robot, 0, ANGLES[1]), "the arm rests at home")
        with bus.lock:
            angles = [step.angle for step in servos[1].executed]
            assert servos[2].joint.angle == pytest.approx(ANGLES[2], abs=TOLERANCE)
        assert min(angles) > ANGLES[1] - TOLERANCE
        assert max(angles) < ANGLES[1] + WAY + TOLERANCE
        assert jumps(bus) == []
