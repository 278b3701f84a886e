"""Clients over DDS that command on through a stop, a fault or a pause: nothing moves after it.

Targets of joint1 move at 0.4 rad/s while motion is rejected. Before, the joint jumped after them at
up to 3 rad/s as soon as that state ended.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from control_msgs.msg import JointJog
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from tests.ros.robot_process import LATCHED, Client, RobotProcess, stamp_s, wait_until
from tests.ros.test_lifecycle import change
from tests.ros.test_trajectory import goal, pose
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState, AxisVelocity
from wmx_ros2_message.srv import SetAxis

from robotd.control.groups.problem import ProblemKind
from robotd_ros.problem_messages import read_problems

pytestmark = pytest.mark.ros

NAMES = [f"joint{number}" for number in range(1, 7)]
RATE_HZ = 50.0
SPEED = 0.4  # rad/s
FASTEST = 1.2  # rad/s, where a target is caught up with that began at the present position
POINTS = "movensys_manipulator_arm_controller/joint_trajectory"
POSITIONS = "forward_position_controller/commands"
VELOCITIES = "forward_velocity_controller/commands"
JOG = "servo_node/delta_joint_cmds"
AXIS_JOG = "wmx/axis/jog"
CMD_VEL = "cmd_vel"
SILENCE_S = 2.0  # that arms a client; one on a busy computer is silent for 0.5 s at times
JOG_SILENCE_S = 0.5  # of ``AXIS_JOG``: its time-out is fixed


def point(target: float, speed: float) -> Any:
    points = [
        JointTrajectoryPoint(
            positions=[target] + [0.0] * 5, time_from_start=Duration(nanosec=20_000_000)
        )
    ]
    return JointTrajectory(joint_names=NAMES, points=points)


def axis_velocity(target: float, speed: float) -> Any:
    return AxisVelocity(index=[0], velocity=[speed], acc=[5.0], dec=[5.0])


MESSAGES: dict[str, tuple[Any, Callable[[float, float], Any]]] = {
    POINTS: (JointTrajectory, point),
    POSITIONS: (Float64MultiArray, lambda target, _: Float64MultiArray(data=[target] + [0.0] * 5)),
    VELOCITIES: (Float64MultiArray, lambda _, speed: Float64MultiArray(data=[speed] + [0.0] * 5)),
    JOG: (JointJog, lambda _, speed: JointJog(joint_names=["joint1"], velocities=[speed])),
    AXIS_JOG: (AxisVelocity, axis_velocity),
}


class Commander:
    """Client that publishes on a topic at ``RATE_HZ`` while ``on``, whatever the robot does."""

    def __init__(self, client: Client, topic: str, message_type: Any, make: Any) -> None:
        self.target, self.speed, self.on, self.sent = 0.0, SPEED, False, 0
        self._make, self._closing = make, threading.Event()
        self._publisher = client.publisher(message_type, f"/{topic}")
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closing.wait(1.0 / RATE_HZ):
            if self.on:
                self.target += self.speed / RATE_HZ
                self.sent += 1
                self._publisher.publish(self._make(self.target, self.speed))


class Arm:
    """The served robot: position of joint1 or of a wheel, and how to reject motion."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.states = client.listen(AxisState, "/wmx/axis/state", 100)
        self._problems = client.listen(DiagnosticArray, "/robotd/problems", LATCHED)
        wait_until(lambda: self.states and self._problems, "axis states and problems")

    @property
    def position(self) -> float:
        return float(self.states[-1].actual_pos[0])

    @property
    def problems(self) -> list[str]:
        found = read_problems(self._problems[-1])
        return [problem.reason for problem in found if problem.kind is ProblemKind.SOURCE]

    def since(self, first: int) -> tuple[float, float]:
        """Return the largest travel and velocity of joint1 since the state ``first``."""
        seen = self.states[first:]
        travel = max(abs(state.actual_pos[0] - seen[0].actual_pos[0]) for state in seen)
        return travel, max(abs(state.actual_velocity[0]) for state in seen)

    def pass_time(self, seconds: float) -> None:
        """Wait until as much time has passed by the robot's own stamps."""
        start = stamp_s(self.states[-1])
        wait_until(lambda: stamp_s(self.states[-1]) > start + seconds, "time")

    def wait_at_rest(self) -> None:
        wait_until(lambda: abs(self.states[-1].actual_velocity[0]) < 1e-3, "standstill")

    def trigger(self, name: str) -> None:
        answer = self.client.call(Trigger, f"/robotd/{name}")
        assert answer.success, answer.message

    def servo(self, on: bool) -> None:
        answer = self.client.call(SetAxis, "/wmx/axis/set_on", index=[0], data=[int(on)])
        assert answer.success, answer.message

    def trip(self) -> None:
        answer = self.client.inject("amp_alarm", axis=0)
        assert answer.success, answer.message
        alarms = self.client.listen(DiagnosticArray, "/robotd/problems", LATCHED)
        wait_until(lambda: alarms and has_alarm(alarms[-1]), "the alarm")


def has_alarm(message: DiagnosticArray) -> bool:
    return any(problem.kind is ProblemKind.ALARM for problem in read_problems(message))


State = tuple[Callable[[Arm], Any], Callable[[Arm], Any]]
STATES: dict[str, State] = {
    "stop": (lambda arm: arm.trigger("stop"), lambda arm: arm.trigger("reset")),
    "alarm": (lambda arm: arm.trip(), lambda arm: arm.trigger("recover")),
    "servo off": (lambda arm: arm.servo(False), lambda arm: arm.servo(True)),
    "pause": (lambda arm: arm.trigger("pause"), lambda arm: arm.trigger("resume")),
    "inactive": (
        lambda arm: change(arm.client, "deactivate"),
        lambda arm: change(arm.client, "activate"),
    ),
}


def managed(robot: str, timeout: str, scenario: Path) -> Iterator[tuple[RobotProcess, Client]]:
    scenario.write_text("schema: 1\nfaults: []\n")  # offers the service for faults
    managed = ("--ros-args", "-p", "wmx_engine_node:managed:=true")
    arguments = ("--set", f"{timeout}={SILENCE_S}", "--scenario", str(scenario), *managed)
    with RobotProcess(*arguments, robot=robot, backend="sim") as process:
        process.wait_output("waiting for the transition configure")
        client = Client(process.domain)
        try:
            assert change(client, "configure")
            assert change(client, "activate")
            yield process, client
        finally:
            client.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RobotProcess, Arm]]:
    scenario = tmp_path_factory.mktemp("arm") / "none.yaml"
    for process, client in managed("cr3a", "stream.timeout_s", scenario):
        yield process, Arm(client)


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[RobotProcess, Arm]]:
    scenario = tmp_path_factory.mktemp("base") / "none.yaml"
    for process, client in managed("baymax", "drive.command_timeout_s", scenario):
        yield process, Arm(client)


@pytest.fixture
def topic(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def commander(served: tuple[RobotProcess, Arm], topic: str) -> Iterator[Commander]:
    _, arm = served
    commander = Commander(arm.client, topic, *MESSAGES[topic])
    commander.target = arm.position
    commander.speed = -SPEED if arm.position > 0.0 else SPEED
    yield commander
    commander.close()
    arm.wait_at_rest()


# Each topic after a stop and one topic after each state: tests/core/control/test_rearming.py has
# every client in every state, in simulated time.
@pytest.mark.parametrize(
    ("topic", "state"),
    [(topic, "stop") for topic in MESSAGES]
    + [(POSITIONS, state) for state in STATES if state != "stop"],
    indirect=["topic"],
)
def test_nothing_moves_after_a_state_until_the_client_has_been_silent(
    served: tuple[RobotProcess, Arm], commander: Commander, topic: str, state: str
) -> None:
    process, arm = served
    begin, end = STATES[state]
    silence_s = JOG_SILENCE_S if topic == AXIS_JOG else SILENCE_S
    start = arm.position
    commander.on = True
    wait_until(lambda: abs(arm.position - start) > 0.1, "the streamed motion")
    begin(arm)
    arm.wait_at_rest()
    sent = commander.sent
    wait_until(lambda: commander.sent > sent + RATE_HZ / 2, "0.2 rad commanded meanwhile")
    logged = len(process.output)
    first = len(arm.states) - 1
    end(arm)
    wait_until(lambda: arm.problems, "the problem")
    (problem,) = arm.problems
    assert problem.startswith(topic)
    assert f"release it (send nothing for {silence_s:g} s)" in problem
    arm.pass_time(0.5)
    assert arm.since(first)[0] < 1e-3
    lines = [line for line in process.output[logged:].splitlines() if "kept commanding" in line]
    assert len(lines) == 1

    commander.on = False
    arm.pass_time(silence_s + 0.2)
    wait_until(lambda: not arm.problems, "no problem")
    assert arm.since(first)[0] < 1e-3
    commander.target = start = arm.position
    commander.on = True
    wait_until(lambda: abs(arm.position - start) > 0.1, "motion anew")
    assert arm.since(first)[1] < FASTEST


@pytest.mark.parametrize("state", ["stop", "alarm", "servo off", "inactive"])
def test_a_base_stands_until_its_client_has_sent_a_zero_twist(
    base: tuple[RobotProcess, Arm], state: str
) -> None:
    _, arm = base
    begin, end = STATES[state]

    def twist(_: float, speed: float) -> Any:
        message = Twist()
        message.linear.x = 0.2 if speed else 0.0
        return message

    commander = Commander(arm.client, CMD_VEL, Twist, twist)
    try:
        start = arm.position
        commander.on = True
        wait_until(lambda: abs(arm.position - start) > 0.1, "motion")
        begin(arm)
        arm.wait_at_rest()
        first = len(arm.states) - 1
        end(arm)
        wait_until(lambda: arm.problems, "the problem")
        assert "cmd_vel kept commanding" in arm.problems[0]
        assert "or send a zero twist, once" in arm.problems[0]
        arm.pass_time(0.5)
        assert arm.since(first)[0] < 1e-3
        commander.speed = 0.0  # streams are best effort: a busy robot may miss one
        wait_until(lambda: not arm.problems, "no problem")
        commander.speed = SPEED
        start = arm.position
        wait_until(lambda: abs(arm.position - start) > 0.1, "motion anew")
        assert not arm.problems
        commander.speed = 0.0
        arm.wait_at_rest()
    finally:
        commander.close()


def test_a_goal_needs_no_beginning_anew(served: tuple[RobotProcess, Arm]) -> None:
    _, arm = served
    arm.pass_time(SILENCE_S)  # since a stream of the tests before
    goals = [goal((2.0, pose(0.2))), goal((2.0, pose(0.0)))]
    sent = arm.client.send_goal(goals[0])
    arm.trigger("stop")
    assert "stopped" in sent.result()[1].error_string
    arm.trigger("reset")
    assert arm.client.send_goal(goals[1]).result()[1].error_code == 0
