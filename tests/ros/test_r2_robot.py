"""The whole robot by the services of WMX R2, over DDS, as a client of that package uses them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from std_srvs.srv import Trigger
from tests.ros.robot_process import Client, RobotProcess, connected, stamp_s, wait_until

from robotd.api import load_robot_descriptor

pytest.importorskip("wmx_r2_message", reason="an older build of the interfaces")

from wmx_r2_message.msg import RobotCartesianPose, RobotStatus
from wmx_r2_message.srv import (
    RobotGetCoordinate,
    RobotId,
    RobotOverrideVelocityByRatio,
    RobotSetCoordinate,
    RobotSetRobotParam,
    RobotStartMotion,
    SetAxisPosition,
    StartAxesPose,
    StartAxesVelocity,
)

pytestmark = pytest.mark.ros

ARM = load_robot_descriptor("cr3a")
NODES = f"nodes=[{','.join(ARM.nodes)},wmx_robot_option_node,axis_reference_node]"
RATE = "ros_parameters.wmx_robot_option_node.robot_status_rate=50.0"
IDLE, LINE, JOINTS, E_STOPPED = 0, 6, 7, 18
USER_E_STOP, SYSTEM_E_STOP = 11, 1
READY = [20.0, -30.0, 90.0, -20.0, 70.0, 0.0]
ABSOLUTE, RELATIVE = {"mode": 0}, {"mode": 1}
TO_POSE, ON_A_LINE = {"target_type": 1}, {"target_type": 1, "path": 1}
IN_TOOL = {"frame": 1}
CLOCK_LATENCY_S = 0.1  # of a client of simulated time


class R2Client:
    """Client of the robot with the id 0."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self._statuses = client.listen(RobotStatus, "/wmx/robot/status", 1)

    @property
    def status(self) -> Any:
        """A status of a time after this call."""
        return self._next(lambda _: True)

    def ask(self, service_type: Any, name: str, **request: Any) -> Any:
        return self.client.call(service_type, f"/wmx/robot/{name}", **request)

    def do(self, name: str) -> str:
        """Call a service without arguments; return its message."""
        answer = self.ask(RobotId, name)
        assert answer.success, answer.message
        return str(answer.message)

    def rejection(self, name: str) -> str:
        answer = self.ask(RobotId, name)
        assert not answer.success
        return str(answer.message)

    def start(self, **request: Any) -> None:
        answer = self.ask(RobotStartMotion, "start_motion", **request)
        assert answer.success, answer.message

    def wait_state(self, state: int) -> Any:
        return self._next(lambda message: message.motion_state == state)

    def move(self, **request: Any) -> Any:
        """Start a motion, and return the status of its end."""
        self.start(**request)
        return self.wait_state(IDLE)

    def override(self, ratio: float) -> Any:
        ratios = {"vel_ratio": ratio, "acc_ratio": 1.0, "dec_ratio": 1.0}
        return self.ask(RobotOverrideVelocityByRatio, "override_velocity_by_ratio", **ratios)

    def _next(self, condition: Callable[[Any], bool]) -> Any:
        now_s = self.client.now_ns * 1e-9 + CLOCK_LATENCY_S
        return self.client.next(
            self._statuses, lambda message: stamp_s(message) > now_s and condition(message)
        )


def displacement(**components: float) -> RobotCartesianPose:
    return RobotCartesianPose(**components)


def numbers(pose: Any) -> list[float]:
    return [pose.x, pose.y, pose.z, pose.u, pose.v, pose.w]


def place(pose: Any) -> np.ndarray:
    return np.array([pose.x, pose.y, pose.z])


def rotation(pose: Any) -> Rotation:
    return Rotation.from_euler("ZYX", [pose.w, pose.v, pose.u], degrees=True)


@pytest.fixture(scope="module")
def served() -> Iterator[R2Client]:
    with RobotProcess("--set", NODES, "--set", RATE, backend="sim", simulated_time=True) as process:
        process.wait_ready()
        with connected(process) as client:
            yield R2Client(client)


@pytest.fixture
def robot(served: R2Client) -> R2Client:
    """At rest in the posture READY."""
    served.move(target_joint=READY)
    wait_until(lambda: served.status.joint_pos_fb == pytest.approx(READY, abs=0.1), "READY")
    return served


def test_joints_move_to_angles_and_by_angles(robot: R2Client) -> None:
    target = [0.0, -40.0, 80.0, 0.0, 60.0, 30.0]
    status = robot.move(target_joint=target)
    assert status.joint_pos_cmd == pytest.approx(target)
    assert status.joint_pos_fb == pytest.approx(target, abs=0.1)
    assert status.header.frame_id == "base_link"
    assert (status.motion_error_code, status.motion_error_joint) == (0, -1)
    status = robot.move(**RELATIVE, target_joint=[5.0, 0.0, 0.0, 0.0, 0.0, -10.0])
    assert status.joint_pos_cmd == pytest.approx([5.0, -40.0, 80.0, 0.0, 60.0, 20.0])


def test_the_tool_goes_to_a_pose_and_along_lines(robot: R2Client) -> None:
    before = robot.status.tool_pose_cmd
    robot.move(**RELATIVE, **TO_POSE, target_pose=displacement(x=-30.0, z=40.0, w=15.0))
    moved = robot.status.tool_pose_cmd
    assert place(moved) == pytest.approx(
        place(before) + place(displacement(x=-30.0, z=40.0)), abs=0.01
    )
    turn = rotation(moved) * rotation(before).inv()
    assert turn.as_euler("ZYX", degrees=True) == pytest.approx([15.0, 0.0, 0.0], abs=0.01)
    status = robot.move(
        **RELATIVE, **ON_A_LINE, **IN_TOOL, target_pose=displacement(z=-50.0, u=10.0)
    )
    along = rotation(moved).apply([0.0, 0.0, -50.0])
    assert place(status.tool_pose_cmd) == pytest.approx(place(moved) + along, abs=0.01)
    turn = rotation(moved).inv() * rotation(status.tool_pose_cmd)
    assert turn.as_euler("ZYX", degrees=True) == pytest.approx([0.0, 0.0, 10.0], abs=0.01)
    status = robot.move(**ABSOLUTE, **ON_A_LINE, target_pose=before)
    assert numbers(status.tool_pose_cmd) == pytest.approx(numbers(before), abs=0.01)
    assert numbers(status.tool_pose_fb) == pytest.approx(numbers(before), abs=1.0)


def test_the_running_motion_is_slowed_down_and_no_later_one(robot: R2Client) -> None:
    robot.start(**RELATIVE, target_joint=[-90.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    robot.wait_state(JOINTS)
    assert robot.override(0.01).success
    wait_until(lambda: 0.0 < -robot.status.joint_velocity_cmd[0] < 3.0, "1 % of 180 degrees/s")
    assert robot.status.motion_state == JOINTS
    assert robot.override(1.0).success
    assert robot.wait_state(IDLE).joint_pos_cmd[0] == pytest.approx(READY[0] - 90.0)
    answer = robot.override(0.5)
    assert answer.message == "no motion of wmx/robot/start_motion runs"
    for ratio in (0.0, 1.5, float("nan")):
        answer = robot.override(ratio)
        assert answer.message == f"vel_ratio is {ratio:g}, must be 0.01 to 1"
        assert not answer.success


def test_a_stop_ends_the_motion_and_its_target(robot: R2Client) -> None:
    before = robot.status.tool_pose_cmd
    robot.start(**RELATIVE, **ON_A_LINE, target_pose=displacement(y=-200.0))
    wait_until(lambda: robot.status.tool_pose_cmd.y < before.y - 5.0, "it moves")
    assert robot.status.motion_state == LINE
    robot.do("stop_motion")
    status = robot.wait_state(IDLE)
    assert status.tool_pose_cmd.y > before.y - 199.0
    assert place(status.tool_pose_cmd)[[0, 2]] == pytest.approx(place(before)[[0, 2]], abs=0.1)
    assert robot.status.joint_pos_cmd == status.joint_pos_cmd
    assert status.motion_error_code == 0


def test_an_e_stop_holds_until_it_is_released(robot: R2Client) -> None:
    robot.start(**RELATIVE, target_joint=[-90.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    wait_until(lambda: robot.status.joint_pos_cmd[0] < READY[0] - 2.0, "it moves")
    robot.do("e_stop")
    status = robot.wait_state(E_STOPPED)
    assert status.motion_error_code == USER_E_STOP
    assert status.joint_pos_cmd[0] > READY[0] - 89.0
    assert "wmx/robot/e_stop" in robot.rejection("clear_motion_error")
    answer = robot.ask(RobotStartMotion, "start_motion", target_joint=READY)
    assert not answer.success
    assert "motion is stopped: by the service wmx/robot/e_stop" in answer.message
    robot.do("release_e_stop")
    assert robot.wait_state(IDLE).joint_pos_cmd == pytest.approx(status.joint_pos_cmd)
    assert robot.do("release_e_stop") == "no e-stop is active"


def test_the_stop_of_the_operator_is_not_the_clients_to_release(robot: R2Client) -> None:
    assert robot.client.call(Trigger, "/robotd/stop").success
    assert robot.wait_state(E_STOPPED).motion_error_code == SYSTEM_E_STOP
    robot.do("e_stop")
    assert "robotd reset" in robot.rejection("release_e_stop")
    assert robot.client.call(Trigger, "/robotd/reset").success
    robot.wait_state(IDLE)


@pytest.mark.parametrize(
    ("request_fields", "message"),
    [
        ({"robot_id": 3, "target_joint": READY}, "robot_id is 3, this node serves 0"),
        ({"mode": 2, "target_joint": READY}, "mode is 2, must be 0 or 1"),
        ({"target_joint": READY[:5]}, "target_joint has 5 values for 6 joints"),
        (
            {"target_joint": [*READY[:5], float("nan")]},
            "target_joint of joint6 is nan, must be a finite number",
        ),
        ({"target_joint": [200.0, *READY[1:]]}, "joint1"),
        (
            {"path": 1, "target_joint": READY},
            "a line (path 1) needs a pose (target_type 1), not joints",
        ),
        ({**TO_POSE, "target_pose": displacement(v=float("inf"))}, "v of the pose is inf"),
        ({**TO_POSE, "target_pose": displacement(x=5000.0)}, "out of reach"),
        ({**TO_POSE, "s": -1}, "s is -1, must be 0"),
        ({**ON_A_LINE, **RELATIVE, "target_pose": displacement(z=5000.0)}, "at "),
    ],
)
def test_what_is_wrong_is_answered_and_moves_nothing(
    robot: R2Client, request_fields: dict[str, Any], message: str
) -> None:
    before = robot.status.joint_pos_cmd
    answer = robot.ask(RobotStartMotion, "start_motion", **request_fields)
    assert not answer.success
    assert message in answer.message
    status = robot.status
    assert status.joint_pos_cmd == before
    assert status.motion_state == IDLE


def test_a_motion_that_runs_is_not_replaced(robot: R2Client) -> None:
    robot.start(**RELATIVE, target_joint=[-90.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    answer = robot.ask(RobotStartMotion, "start_motion", target_joint=READY)
    assert answer.message == "a move of the tool: the joints move"
    assert robot.rejection("release_robot") == "the robot moves: stop_motion first"
    robot.do("stop_motion")
    robot.wait_state(IDLE)


def test_the_frame_of_the_tool(robot: R2Client) -> None:
    frame = displacement(x=10.0, z=120.0, u=90.0)
    bare = robot.status.tool_pose_cmd
    assert robot.ask(RobotSetCoordinate, "set_tool_coordinate", pose=frame).success
    answer = robot.ask(RobotGetCoordinate, "get_tool_coordinate")
    assert numbers(answer.pose) == pytest.approx(numbers(frame))
    wanted = place(bare) + rotation(bare).apply(place(frame))
    assert place(robot.status.tool_pose_cmd) == pytest.approx(wanted)
    assert robot.ask(RobotSetCoordinate, "set_tool_coordinate", pose=displacement()).success
    assert numbers(robot.status.tool_pose_cmd) == pytest.approx(numbers(bare))


def test_the_robot_is_released_and_taken_up_again(robot: R2Client) -> None:
    robot.do("release_robot")
    assert robot.rejection("clear_motion_error").startswith("no robot is registered")
    answer = robot.ask(RobotSetRobotParam, "set_robot_param", param_file="/robots/other.xml")
    assert not answer.success
    assert "leave it empty, or name" in answer.message
    answer = robot.ask(RobotSetRobotParam, "set_robot_param", param_file=str(ARM.urdf))
    assert answer.success, answer.message
    assert (answer.robot_id, answer.num_joints) == (0, 6)
    assert robot.status.robot_id == 0


def test_the_reference_of_an_axis_is_zero_only(robot: R2Client) -> None:
    def reference(position: float) -> Any:
        request = {"index": [5], "position": [position]}
        return robot.client.call(SetAxisPosition, "/wmx/axis/reference", **request)

    robot.move(target_joint=[*READY[:5], 20.0])
    answer = reference(0.5)
    assert not answer.success
    assert answer.message.startswith("joint6: position 0.5 must be 0")
    answer = reference(0.0)
    assert answer.success, answer.message
    assert robot.status.joint_pos_fb[5] == pytest.approx(0.0, abs=0.1)


def test_an_axis_is_started_with_an_answer(robot: R2Client) -> None:
    def start(name: str, service_type: Any = StartAxesPose, **request: Any) -> Any:
        request = {"axis": [5], "velocity": [1.0], "acc": [5.0], "dec": [5.0], **request}
        return robot.client.call(service_type, f"/wmx/axes/{name}", **request)

    robot.move(target_joint=READY)
    assert start("start_pos", target=[0.2]).message == "begun"
    robot.wait_state(JOINTS)
    assert robot.wait_state(IDLE).joint_pos_fb[5] == pytest.approx(np.degrees(0.2), abs=0.1)
    assert start("start_mov", target=[-0.1]).success
    robot.wait_state(JOINTS)
    assert robot.wait_state(IDLE).joint_pos_fb[5] == pytest.approx(np.degrees(0.1), abs=0.1)
    assert start("start_pos", target=[100.0]).message.startswith("joint6: ")
    assert "has 2 values for 1 axes" in start("start_mov", target=[0.1, 0.2]).message
    answer = start("start_vel", StartAxesVelocity)
    assert not answer.success  # in position mode
    assert "mode" in answer.message
