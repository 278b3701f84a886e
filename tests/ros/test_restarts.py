"""A robotd that is killed and restarted under clients that never cease to command moves nothing.

Their publishers live on and are discovered at any time after the start, so the robot must not take
the time before for silence.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from control_msgs.msg import JointJog
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from std_msgs.msg import Float64MultiArray
from tests.ros.robot_process import LATCHED, Client, RobotProcess, stamp_s, wait_until
from tests.ros.test_rearming import (
    AXIS_JOG,
    CMD_VEL,
    JOG,
    MESSAGES,
    NAMES,
    POINTS,
    POSITIONS,
    RATE_HZ,
    SILENCE_S,
    SPEED,
    VELOCITIES,
)
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from wmx_ros2_message.msg import AxisPose, AxisState

from robotd.api import load_robot_descriptor
from robotd.control.groups.problem import ProblemKind
from robotd_ros.problem_messages import read_problems
from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros

TARGET = 1.0  # rad, far from where the joints are
MIN_STATES = 20
SHORTEST_S, JITTER_S = 0.5, 0.1  # silence that arms a source of whole trajectories
STANDSTILL = 2e-3  # rad; drives settle after they are switched on
TORQUE_ROBOT = Path(__file__).parents[1] / "plugins" / "canopen" / "bus" / "torque_drives.yaml"
EFFORTS = "forward_effort_controller/commands"
TWISTS, POSES = "servo_node/delta_twist_cmds", "servo_node/pose_target_cmds"
MOVES, DISTANCES = "wmx/axis/position", "wmx/axis/position/relative"
TRAJECTORIES = f"{POINTS} (trajectories)"
WINDOWS = f"{POINTS} (windows)"
# Time of the simulation is slow: a client on a busy computer is silent for less of it.
SLOWLY = ("--time-scale", "0.2")
SERVO = f"nodes=[{','.join(load_robot_descriptor('cr3a').nodes)},servo_node]"
ARM = ("--set", f"stream.timeout_s={SILENCE_S}")
BASE = ("--set", f"drive.command_timeout_s={SILENCE_S}")

Make = Callable[[], Any]
Clients = dict[str, tuple[Any, Make]]  # by topic, or topic and kind of message


def points(*times_s: float) -> Any:
    """A trajectory on its way to ``TARGET`` that moves at its points."""
    made = [
        JointTrajectoryPoint(
            positions=[TARGET + SPEED * time_s] + [0.0] * 5,
            velocities=[SPEED if time_s < times_s[-1] or time_s < 1.0 else 0.0] + [0.0] * 5,
            time_from_start=Duration(sec=int(time_s), nanosec=round(time_s % 1.0 * 1e9)),
        )
        for time_s in times_s
    ]
    return JointTrajectory(joint_names=NAMES, points=made)


def twist(message_type: Any) -> Any:
    message = message_type()
    (message.twist if message_type is TwistStamped else message).linear.x = 0.2
    return message


def pose() -> Any:
    message = PoseStamped()
    message.pose.position.x, message.pose.position.z = 0.3, 0.5
    message.pose.orientation.w = 1.0
    return message


def axis_pose(target: float) -> Any:
    return AxisPose(index=[1], target=[target], velocity=[0.5], acc=[5.0], dec=[5.0])


def joints(*topics: str) -> Clients:
    return {
        topic: (MESSAGES[topic][0], lambda topic=topic: MESSAGES[topic][1](TARGET, SPEED))
        for topic in topics
    }


STREAMS: Clients = {
    **joints(POINTS, POSITIONS, VELOCITIES, JOG),
    WINDOWS: (JointTrajectory, lambda: points(0.0, 0.03, 0.06, 0.09)),
    TRAJECTORIES: (JointTrajectory, lambda: points(1.0, 2.0)),
}
AXES: Clients = {
    **joints(AXIS_JOG),
    MOVES: (AxisPose, lambda: axis_pose(TARGET)),
    DISTANCES: (AxisPose, lambda: axis_pose(0.1)),
}
TOOL: Clients = {
    TWISTS: (TwistStamped, lambda: twist(TwistStamped)),
    POSES: (PoseStamped, pose),
}
TORQUES: Clients = {EFFORTS: (Float64MultiArray, lambda: Float64MultiArray(data=[6.0, 0.0]))}


def base(topic: str, message_type: Any) -> Clients:
    return {topic: (message_type, lambda: twist(message_type))}


class Commanders:
    """Clients that command at ``RATE_HZ``, each on its topic, whatever robotd does.

    Attributes:
        silence_s: longest time between two rounds: their thread waits on a busy computer.
    """

    def __init__(self, client: Client, clients: Clients) -> None:
        self.topics = {name.partition(" ")[0] for name in clients} - {POSES}  # named as the twists
        self.on, self.rounds, self.silence_s = True, 0, 0.0
        self._closing = threading.Event()
        self._publishers = [
            (client.node.create_publisher(message_type, f"/{name.partition(' ')[0]}", 10), make)
            for name, (message_type, make) in clients.items()
        ]
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        before_s = time.monotonic()
        while not self._closing.wait(1.0 / RATE_HZ):
            if self.on:
                for publisher, make in self._publishers:
                    publisher.publish(make())
                self.rounds += 1
            before_s, gap_s = time.monotonic(), time.monotonic() - before_s
            self.silence_s = max(self.silence_s, gap_s)


class Restarted:
    """States and problems that a client sees of one robotd after the other."""

    def __init__(self, client: Client) -> None:
        self.states = client.listen(AxisState, "/wmx/axis/state", 100)
        self._problems = client.listen(DiagnosticArray, "/robotd/problems", LATCHED)

    def forget(self) -> None:
        """Forget the robotd before."""
        self.states.clear()
        self._problems.clear()

    @property
    def problems(self) -> list[str]:
        found = read_problems(self._problems[-1]) if self._problems else ()
        return [problem.reason for problem in found if problem.kind is ProblemKind.SOURCE]

    @property
    def travel(self) -> float:
        """Largest distance of an axis from where it was first, rad; NaN is none."""
        positions = np.array([state.actual_pos for state in tuple(self.states)])
        return float(np.nanmax(np.nanmax(positions, axis=0) - np.nanmin(positions, axis=0)))

    def pass_time(self, seconds: float) -> None:
        """Wait until as much time has passed by the robot's own stamps."""
        start_s = stamp_s(self.states[-1])
        wait_until(lambda: stamp_s(self.states[-1]) > start_s + seconds, "time")


@contextmanager
def restarting(
    clients: Clients, restarts: int, *arguments: str, **options: Any
) -> Iterator[tuple[Commanders, Restarted]]:
    """Kill and start robotd under ``clients``; it moves nothing. The last one is left running."""
    with own_domain() as domain:
        client = Client(domain)
        commanders, seen = Commanders(client, clients), Restarted(client)
        try:
            for number in range(restarts + 1):
                seen.forget()
                commanders.silence_s = 0.0
                with RobotProcess(*arguments, domain=domain, **options) as process:
                    process.wait_ready()
                    assert_all_rejected(commanders, seen)
                    if number == restarts:
                        yield commanders, seen
                    process.process.send_signal(signal.SIGKILL)
        finally:
            commanders.close()
            client.close()


def assert_all_rejected(commanders: Commanders, seen: Restarted) -> None:
    """Wait until each topic is received and rejected; nothing has moved by then, and after it."""

    def is_named(topic: str) -> bool:
        return any(problem.lstrip("/").startswith(topic) for problem in seen.problems)

    for topic in sorted(commanders.topics):
        wait_until(lambda topic=topic: is_named(topic), f"{topic} among {seen.problems}")
    rounds = commanders.rounds
    wait_until(lambda: commanders.rounds > rounds + RATE_HZ / 2, "further commands")
    wait_until(lambda: len(seen.states) > MIN_STATES, "states of the axes")
    # A commander that was silent for as long, against its will, may move the robot.
    assert seen.travel < STANDSTILL or commanders.silence_s > SHORTEST_S - JITTER_S


def assert_released(commanders: Commanders, seen: Restarted, *, silence_s: float) -> None:
    """The clients move the robot when they have been silent."""
    commanders.on = False
    seen.pass_time(silence_s + 0.2)
    wait_until(lambda: not seen.problems, "no problem")
    assert seen.travel < STANDSTILL
    commanders.on = True
    wait_until(lambda: seen.travel > 0.1, "motion")


def test_every_stream_of_an_arm() -> None:
    """Afterwards the last of them, alone, moves the arm when it was silent."""
    with restarting(STREAMS, 3, *SLOWLY, backend="sim"):
        pass


def test_topics_of_single_axes_and_of_the_tool() -> None:
    with restarting(AXES | TOOL, 2, *SLOWLY, "--set", SERVO, backend="sim"):
        pass


@pytest.mark.parametrize("kind", [POSITIONS, WINDOWS, TRAJECTORIES, JOG])
def test_a_client_that_was_silent_after_the_restart_moves_the_arm(kind: str) -> None:
    with restarting({kind: STREAMS[kind]}, 1, *SLOWLY, backend="sim") as (commanders, seen):
        assert_released(commanders, seen, silence_s=0.5)


def test_a_client_that_is_new_after_the_restart_moves_the_arm_at_once() -> None:
    with own_domain() as domain, RobotProcess(domain=domain, backend="sim") as process:
        client = Client(domain)
        seen = Restarted(client)
        publisher = client.publisher(JointJog, f"/{JOG}")
        process.wait_ready()
        wait_until(lambda: seen.states, "states")
        seen.pass_time(0.5)  # the robot discovers a publisher later than that its subscription

        def moves() -> bool:
            publisher.publish(JointJog(joint_names=["joint1"], velocities=[SPEED]))
            return seen.travel > 0.1

        wait_until(moves, "motion")
        assert not seen.problems
        client.close()


@pytest.mark.parametrize(
    ("robot", "topic", "message_type"),
    [
        ("baymax", CMD_VEL, Twist),
        ("mecanum_base", "mecanum_drive_controller/reference", TwistStamped),
        ("tricycle_base", "tricycle_controller/cmd_vel", TwistStamped),
    ],
)
def test_bases(robot: str, topic: str, message_type: Any) -> None:
    clients = base(topic, message_type)
    with restarting(clients, 2, *SLOWLY, robot=robot, backend="sim") as (commanders, seen):
        assert_released(commanders, seen, silence_s=0.5)


@pytest.mark.parametrize("backend", ["canopen", "ethercat", "mujoco"])
def test_every_backend(backend: str) -> None:
    variant = () if backend == "mujoco" else ("--variant", f"{backend}_simulated")
    with restarting(STREAMS, 2, *ARM, *variant, backend=backend):
        pass
    with restarting(base(CMD_VEL, Twist), 2, *BASE, *variant, robot="baymax", backend=backend):
        pass


def test_torques(tmp_path: Path) -> None:
    robot = tmp_path / "robot.yaml"
    robot.write_text(f"""extends: {TORQUE_ROBOT}
name: torque_arm
nodes: [wmx_engine_node, wmx_core_motion_node, manipulator_state, joint_command_node]
ros_parameters:
  manipulator_state: {{encoder_joint_topic: joint_states}}
  joint_command_node: {{effort_commands_topic: {EFFORTS}, command_timeout_s: {SILENCE_S}}}
""")
    with restarting(TORQUES, 2, robot=str(robot), backend="canopen", patient=False):
        pass
