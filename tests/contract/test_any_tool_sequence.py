"""Whatever is asked of the tool of an arm: no link comes close to a guarded body.

As ``test_any_sequence``, with lines, poses, twists, tools, work frames and reduced speed. Judged
besides: the distance of the links from each other, from planes and from a box, and the speed of the
tool where it is reduced. Not judged: the distance after a fault that moved the arm.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from random import Random

import numpy as np
import pytest
from tests.contract.sequences import Commands, Witness, one_of
from tests.contract.test_any_sequence import PERIODS, ArmPlay, arm_commands, profile
from tests.core.control.harness import Harness

from robotd.api import FloatArray, load_robot_descriptor
from robotd.device.process_image import ProcessImage
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRejected
from robotd.motion.profile import Profile
from robotd_tool_space import ToolGroups, reduced_speed
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.geometry.rotations import pose_of
from robotd_tool_space.paths.tool_motion import ToolMotion
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.streams.tool_stream import ToolStream
from robotd_tool_space.streams.twist import PoseCommand

JOINTS = 6
BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
ROBOT = """\
extends: cr3a
name: arm
engine: {open_retry_s: 0.0, servo_timeout_s: 0.5}
cycle: {rate_hz: 500, realtime_priority: 0}
tool_space:
  velocity_m_s: 0.6
  tools:
    tip: {xyz_m: [0.05, 0.0, 0.15], rpy_rad: [0.3, 0, 0]}
    long: {xyz_m: [0.0, -0.1, 0.1]}
  work_frames:
    table: {xyz_m: [0.3, 0.1, 0.1], rpy_rad: [0, 0, 0.7]}
  collisions:
    planes:
      wall: {normal: [0, -2, 0], distance_m: -0.35}
      floor: {normal: [0, 0, 1], distance_m: -0.05}
    boxes:
      machine: {xyz_m: [-0.75, 0, 0.4], size_m: [0.4, 1, 0.8]}
"""
MARGIN_M = 0.01
BEYOND_M = 0.002  # the margin, at most: the path of a stop is foreseen by its ends and its middle
REDUCED_M_S = 0.33  # streams of joints that compensate each other, at a limit of 0.25: decision 62
SLOWED_S = 0.6  # after reduced speed is on, or after a stall
LOOK_PERIODS = 5  # between two looks at the distances
TWIST_PERIODS = 20  # between two commands of a client


def positions(random: Random) -> list[float]:
    return [float(bent) + random.uniform(-1.2, 1.2) for bent in BENT]


def displacement(random: Random) -> list[float]:
    """Return a displacement in m and rad, or a twist in m/s and rad/s."""
    linear, angular = random.choice([0.05, 0.2, 0.5]), random.choice([0.0, 0.0, 0.4, 1.2])
    return [random.uniform(-bound, bound) for bound in [linear] * 3 + [angular] * 3]


def displacements(random: Random) -> list[list[float]]:
    return [displacement(random) for _ in range(random.choice([1, 1, 1, 2, 3]))]


def speed(random: Random) -> float:
    return random.uniform(-4.0, 4.0)


COMMANDS: Commands = {
    **arm_commands(JOINTS, positions),
    "line": (9, (displacements, one_of(0.1, 0.5, 1.0, 1.0), one_of(0.0, 0.0, 0.02, 0.1), PERIODS)),
    "pose": (4, (displacement, one_of(0.1, 1.0), PERIODS)),
    "joints": (4, (positions, one_of(0.1, 1.0, 1.0), PERIODS)),
    "open_tool": (3, (one_of(0.05, 0.2, 1.0),)),
    "twist": (7, (displacement, one_of(False, True), PERIODS)),
    "to_pose": (4, (displacement, PERIODS)),
    "jog_one": (2, (one_of(*range(JOINTS)), speed, profile, PERIODS)),
    "home": (6, ()),
    "release": (12, ()),
    "tool": (2, (one_of("", "tip", "long"),)),
    "frame": (1, (one_of("", "table"),)),
    "reduced": (2.5, (one_of(False, True, True),)),
}


class ToolWitness(Witness):
    """Judges the distances of the links and the speed of the tool, too."""

    def __init__(self, harness: Harness, velocity: FloatArray, acceleration: FloatArray) -> None:
        super().__init__(harness, velocity, acceleration)
        robot = harness.robot
        tool = robot.feature(ToolGroups).only
        settings = robot.descriptor.settings(ToolSpaceKeys).tool_space.collisions
        assert settings is not None
        self._collisions = Collisions.of(robot.descriptor, tool.at_link, settings)
        self._least: FloatArray | None = None  # by which the present distances are judged
        self._looks = 0
        self._tool, self._reduced = tool, robot.feature(reduced_speed)
        self._kinematics, self._point = tool.kinematics, np.zeros(3)
        self._reduced_s = 0.0  # since it is on, and nothing has stalled or failed

    def look(self, image: ProcessImage | None = None) -> None:
        is_moved, before_ns = bool(self.excused.any()), self._time_ns
        super().look(image)
        self._judge_speed((self._time_ns - before_ns) / 1e9)
        self._looks += 1
        if is_moved or self._least is None:
            self._least = np.minimum(self._distances(), MARGIN_M)
        elif self._looks % LOOK_PERIODS == 0:
            distances = self._distances()
            if (distances < self._least - BEYOND_M).any():
                near = int((distances - self._least).argmin())
                first, second = self._collisions.names[near]
                apart_mm, least_mm = 1e3 * distances[near], 1e3 * self._least[near]
                text = f"{apart_mm:.1f} mm apart, were {least_mm:.1f} mm"
                self.seen.append(f"{first} and {second} are {text}")
            # Within the margin it may stay as near as it is, and goes back no more once it is out.
            self._least = np.maximum(self._least, np.minimum(distances, MARGIN_M))

    def _judge_speed(self, elapsed_s: float) -> None:
        """Judge the speed of the tool where it is reduced, and has had time to slow down."""
        before, kinematics = self._point, self._kinematics
        self._kinematics = self._tool.kinematics
        self._point = self._kinematics.forward(self._position)[:3, 3]
        is_steady = elapsed_s < 1.5 * self._period_s and not self.excused.any()
        self._reduced_s = self._reduced_s + elapsed_s if self._reduced.is_on and is_steady else 0.0
        if self._reduced_s > SLOWED_S and self._kinematics is kinematics and elapsed_s > 0.0:
            speed = float(np.linalg.norm(self._point - before)) / elapsed_s
            if speed > REDUCED_M_S:
                self.seen.append(f"the tool moves with {speed:.3f} m/s")

    def _distances(self) -> FloatArray:
        (distances,) = self._collisions.distances(self._position[None])
        return distances


class ToolPlay(ArmPlay):
    """An arm among walls, its tool, and what clients of the tool hold."""

    witness_type = ToolWitness

    def __init__(self, file: Path) -> None:
        super().__init__(load_robot_descriptor(file))
        self._tool_space = self.robot.feature(ToolGroups).only
        self._tool_streams: list[ToolStream] = []

    def _follow(self, motion: ToolMotion, periods: int) -> None:
        goal = ExitStack()
        goal.enter_context(self._tool_space.follow(motion))
        self.goals.append(goal)
        self._step(periods)

    def _line(
        self, displacements: list[list[float]], speed: float, blend_m: float, periods: int
    ) -> None:
        pose, poses = self._tool_space.pose, []
        for displacement in displacements:
            pose = _moved(pose, displacement)
            poses.append(pose)
        self._follow(self._tool_space.plan_lines(poses, speed, blend_m), periods)

    def _pose(self, displacement: list[float], speed: float, periods: int) -> None:
        target = self._tool_space.relative(pose_of(displacement[:3], displacement[3:]))
        self._follow(self._tool_space.plan_move(target, speed), periods)

    def _joints(self, goal: list[float], speed: float, periods: int) -> None:
        self._follow(self._tool_space.plan_joints(np.array(goal), speed), periods)

    def _open_tool(self, timeout_s: float) -> None:
        stream = self._tool_space.stream(timeout_s=timeout_s)
        self._tool_streams.append(stream)
        self.streams.append(stream.joints)

    def _twist(self, twist: list[float], in_tool: bool, periods: int) -> None:
        if self._tool_streams:
            stream = self._tool_streams[-1]
            self._insist(lambda: stream.send(twist, in_tool=in_tool), periods)

    def _to_pose(self, displacement: list[float], periods: int) -> None:
        if self._tool_streams:
            stream = self._tool_streams[-1]
            at = self.robot.image.position_command[:JOINTS]
            command = PoseCommand(_moved(self._tool_space.kinematics.forward(at), displacement))
            send = stream.joints.send_reference
            self._insist(lambda: send(stream._stage, command, moves=True), periods)

    def _insist(self, send: Callable[[], None], periods: int) -> None:
        """Send on for a while, as a client does that looks at no answer."""
        for _ in range(0, periods, TWIST_PERIODS):
            with suppress(RobotdError):
                send()
            self._step(min(periods, TWIST_PERIODS))

    def _jog_one(self, axis: int, speed: float, how: Profile, periods: int) -> None:
        self.robot.axes.set_command_mode(axis, 1)
        self._jog([axis], [speed] * JOINTS, how)
        self._step(periods)

    def _home(self) -> None:
        self._release()
        self._bring_back()
        self.robot.set_speed(1.0)
        self.robot.axes.stop_and_wait(self._axes, 20.0)
        self._bring_back()
        self._tool_space.execute(self._tool_space.plan_joints(BENT))

    def _release(self) -> None:
        self.release()
        self.goals.clear()
        self.streams.clear()
        self._tool_streams.clear()

    def _tool(self, name: str) -> None:
        self._tool_space.select_tool(name)

    def _frame(self, name: str) -> None:
        self._tool_space.select_work_frame(name)

    def _reduced(self, on: bool) -> None:
        self.robot.feature(reduced_speed).set(on)

    def end(self) -> None:
        """Mend everything; the arm takes goals, those that lead through a wall excepted."""
        self.mend()
        self.robot.feature(reduced_speed).set(False)
        with suppress(TrajectoryRejected):
            self._tool_space.execute(self._tool_space.plan_joints(BENT))
            self._tool_space.move_line(self._tool_space.pose_relative(z=-0.05))


def _moved(pose: FloatArray, displacement: list[float]) -> FloatArray:
    result = pose.copy()
    result[:3, 3] += displacement[:3]
    result[:3, :3] = pose_of([0.0, 0.0, 0.0], displacement[3:])[:3, :3] @ pose[:3, :3]
    return result


LONG = [pytest.param(seed, marks=pytest.mark.long) for seed in range(5)]


@pytest.mark.parametrize("seed", [*LONG, 5])
def test_no_link_comes_close_to_a_guarded_body(tmp_path: Path, seed: int) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(ROBOT, encoding="utf-8")
    ToolPlay(file).run(Random(seed), COMMANDS, 60)
