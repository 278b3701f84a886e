"""WMX R2 without ROS: units, requests, and the motion of a simulated arm with its state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robotd import Robot, open_robot
from robotd.api import InvalidArgument, NotReady, wait_until
from robotd.clock.simulated import SteppedClock
from robotd_tool_space import ToolGroups
from robotd_tool_space.nodes.r2_motion import E_STOP, R2Error, R2Motion, R2State
from robotd_tool_space.nodes.r2_node import fill_r2_pose, joints_of_r2, pose_of_r2, r2_factors
from robotd_tool_space.paths.tool_motion import ToolMotion

BENT = np.array([0.0, 0.3, 1.4, -0.2, 1.2, 0.0])
FAR = np.array([-1.5, *BENT[1:]])
ANGLES = st.floats(-360.0, 360.0)
LENGTHS = st.floats(-2000.0, 2000.0)


def message(*numbers: float) -> Any:
    return SimpleNamespace(**dict(zip("xyzuvw", numbers, strict=True)))


@given(st.tuples(LENGTHS, LENGTHS, LENGTHS), st.tuples(ANGLES, ANGLES, ANGLES))
def test_a_pose_is_mm_and_degrees_about_z_y_x(
    place: tuple[float, float, float], turn: tuple[float, float, float]
) -> None:
    pose = pose_of_r2(message(*place, *turn))
    assert pose[:3, 3] == pytest.approx(np.array(place) / 1000.0)
    rotation = Rotation.from_euler("ZYX", turn[::-1], degrees=True).as_matrix()
    assert pose[:3, :3] == pytest.approx(rotation, abs=1e-9)
    answer = message(*[0.0] * 6)
    fill_r2_pose(answer, pose)
    assert [answer.x, answer.y, answer.z] == pytest.approx(place, abs=1e-9)
    assert abs(answer.v) <= 90.0
    assert pose_of_r2(answer) == pytest.approx(pose, abs=1e-6)


def test_in_gimbal_lock_the_yaw_has_the_rest() -> None:
    answer = message(*[0.0] * 6)
    fill_r2_pose(answer, pose_of_r2(message(0.0, 0.0, 0.0, 30.0, 90.0, 50.0)))
    assert (answer.u, answer.v, answer.w) == pytest.approx((0.0, 90.0, 20.0))


def test_joints_are_degrees_and_mm() -> None:
    factors = r2_factors(["rad", "m"])
    assert joints_of_r2([180.0, 250.0], ["a", "b"], factors) == pytest.approx([np.pi, 0.25])
    with pytest.raises(InvalidArgument, match="has 1 values for 2 joints"):
        joints_of_r2([1.0], ["a", "b"], factors)
    with pytest.raises(InvalidArgument, match="target_joint of b is inf"):
        joints_of_r2([1.0, np.inf], ["a", "b"], factors)


class Arm:
    """Simulated arm in stepped time; what waits is run by ``end``."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tool = robot.feature(ToolGroups).only
        self.motion = R2Motion(robot, self.tool, self._defer)
        self._waiting: list[Callable[[], None]] = []

    @property
    def state(self) -> tuple[R2State, R2Error, int]:
        state, fault = self.motion.state(self.robot.image.copy())
        return state, fault.code, fault.joint

    @property
    def position(self) -> list[float]:
        values: list[float] = self.robot.image.copy().position_command.tolist()
        return values

    def start(self, goal: Any = FAR) -> None:
        arrival = self.motion.arrive(None)
        self.motion.start(lambda: self.tool.plan_joints(goal), arrival, is_line=False)

    def end(self) -> None:
        """Run until the joints are at rest, and end what has waited for that."""
        assert wait_until(lambda: not self.tool.group.motion.moving, 60.0, self.robot.clock)
        while self._waiting:
            self._waiting.pop()()

    def run(self, seconds: float) -> None:
        self.robot.step(round(seconds * self.robot.descriptor.cycle.rate_hz))

    def _defer(self, function: Callable[..., None], *args: Any, until_rest: bool) -> None:
        assert until_rest  # services do not queue behind it
        self._waiting.append(partial(function, *args))


@pytest.fixture
def arm() -> Iterator[Arm]:
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        yield Arm(robot)


def test_states_of_a_motion_that_is_stopped(arm: Arm) -> None:
    assert arm.state == (R2State.IDLE, R2Error.NONE, -1)
    arm.start()
    arm.run(0.3)
    assert arm.state[0] == R2State.JOINTS
    arm.robot.pause()
    arm.run(1.0)
    assert arm.state[0] == R2State.PAUSED_JOINTS
    arm.robot.resume()
    arm.run(0.3)
    arm.motion.stop()
    arm.run(0.02)
    assert arm.state[0] == R2State.STOPPING_JOINTS
    arm.end()
    assert arm.state == (R2State.IDLE, R2Error.NONE, -1)


def test_a_fault_is_kept_until_it_is_cleared(arm: Arm) -> None:
    arm.start()
    arm.run(0.3)
    arm.robot.fault_injector.trip(2, 0x2310)
    arm.end()
    failed = (R2State.ERROR, R2Error.AMPLIFIER, 2)
    assert arm.state == failed
    with pytest.raises(NotReady, match="joint3: amplifier alarm"):
        arm.motion.clear_error()
    arm.robot.axes.clear_alarm(2)
    arm.robot.axes.servo(2, True)
    assert arm.state == failed
    with pytest.raises(NotReady, match="the last motion failed"):
        arm.start()
    arm.motion.clear_error()
    assert arm.state[0] == R2State.IDLE
    arm.start(BENT)


@pytest.mark.parametrize(
    ("disturb", "code"),
    [
        (lambda robot: robot.fault_injector.block(0, True), R2Error.FOLLOWING),
        (lambda robot: robot.axes.servo(0, False), R2Error.SERVO_OFF),
        (lambda robot: robot.fault_injector.disconnect(0), R2Error.OFFLINE),
    ],
    ids=["blocked", "servo off", "offline"],
)
def test_the_reason_of_a_failed_motion(
    arm: Arm, disturb: Callable[[Robot], None], code: R2Error
) -> None:
    arm.start()
    arm.run(0.3)
    disturb(arm.robot)
    arm.end()
    assert arm.state == (R2State.ERROR, code, 0)


def test_an_e_stop_is_faster_than_a_stop_and_no_error_behind_it(arm: Arm) -> None:
    def stopping_distance(stop: Callable[[], None]) -> float:
        arm.start()
        arm.run(0.8)
        began = arm.position[0]
        stop()
        arm.end()
        return abs(arm.position[0] - began)

    on_the_path = stopping_distance(arm.motion.stop)
    arm.start(BENT)
    arm.end()
    assert stopping_distance(arm.motion.e_stop) < on_the_path
    assert arm.state == (R2State.E_STOPPED, R2Error.USER_E_STOP, -1)
    with pytest.raises(NotReady, match=E_STOP):
        arm.start()
    arm.motion.release_e_stop()
    assert arm.state == (R2State.IDLE, R2Error.NONE, -1)


def test_a_request_does_not_take_over_from_one_that_began_while_it_was_planned(arm: Arm) -> None:
    first, second = arm.motion.arrive(None), arm.motion.arrive(None)

    def plan() -> ToolMotion:
        motion = arm.tool.plan_joints(BENT)
        arm.motion.start(lambda: arm.tool.plan_joints(FAR), first, is_line=False)
        return motion

    with pytest.raises(NotReady, match="the joints move"):
        arm.motion.start(plan, second, is_line=False)
    arm.end()
    assert arm.position[:6] == pytest.approx(FAR)


@pytest.mark.parametrize("by", ["client", "operator"])
def test_a_request_from_before_a_stop_moves_nothing(arm: Arm, by: str) -> None:
    arrival, before = arm.motion.arrive(None), arm.position
    if by == "client":
        arm.motion.stop()
    else:
        arm.robot.stop()
        arm.robot.reset()
    with pytest.raises(NotReady, match="motion was stopped before this one began"):
        arm.motion.start(lambda: arm.tool.plan_joints(BENT), arrival, is_line=False)
    arm.run(0.5)
    assert arm.position == before
    arm.start(BENT)
