"""MoveIt Servo of Jazzy, emulated, moves an arm over the trajectory topic."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tests.ros.robot_process import Client, RobotProcess, connected, stamp_s, wait_until
from tests.ros.servo_emulator import Jog, Message, ServoEmulator
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS

pytestmark = pytest.mark.ros

NAMES = [f"joint{number}" for number in range(1, 7)]
TOPIC = "/movensys_manipulator_arm_controller/joint_trajectory"
SPEED = 0.3
REST_S = 0.5
OLD_S = 0.1  # at ``SPEED``, the travel of this time in one period is close to the velocity limit


def time_of(seconds: float, made: Any) -> Any:
    whole, nanoseconds = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return made(sec=whole, nanosec=nanoseconds)


def ros_message(message: Message) -> Any:
    rows = zip(message.times_s, message.position, message.velocity, strict=True)
    return JointTrajectory(
        header=Header(stamp=time_of(message.stamp_s, Time)),
        joint_names=NAMES,
        points=[
            JointTrajectoryPoint(
                positions=position.tolist(),
                velocities=velocity.tolist(),
                time_from_start=time_of(time_s, Duration),
            )
            for time_s, position, velocity in rows
        ],
    )


class Arm:
    """Servo node that jogs the arm in real time, and the states of the arm."""

    def __init__(self, client: Client) -> None:
        self._received = client.listen(JointState, "/joint_states")
        self._publisher = client.publisher(JointTrajectory, TOPIC)
        # Age of the oldest state that Servo took as the present one, or longest time between turns.
        self.oldest_s = 0.0
        wait_until(lambda: self._received, "joint states")

    @property
    def position(self) -> FloatArray:
        return np.array(self._received[-1].position[:6])

    def run(
        self, servo: ServoEmulator, velocity: Callable[[float], float | None], duration_s: float
    ) -> Jog:
        """Jog joint 1 with ``velocity``, joint 2 the other way, then wait for standstill.

        Where ``velocity`` is None, the commands have ended, and Servo halts. Its argument counts
        the turns of Servo's loop: a stall of this process delays the jog and takes nothing from it.
        """
        messages = []
        due_s = turned_s = time.time()
        for turn in range(round(duration_s / servo.publish_period)):
            time.sleep(max(0.0, due_s - time.time()))
            now_s = time.time()
            due_s += servo.publish_period
            if now_s > due_s + servo.publish_period:  # as rclcpp::Rate after a missed cycle
                due_s = now_s + servo.publish_period
            self.oldest_s = max(
                self.oldest_s, now_s - stamp_s(self._received[-1]), now_s - turned_s
            )
            turned_s = now_s
            speed = velocity(turn * servo.publish_period)
            if speed is None:
                message = servo.halt(now_s, self.position)
            else:
                speeds = [speed, -speed / 2, 0.0, 0.0, 0.0, 0.0]
                message = servo.jog(now_s, speeds, self.position)
            if message is not None:
                self._publisher.publish(ros_message(message))
                messages.append(message)

        ended_s = time.time()

        def at_rest() -> bool:
            """For a while: where it turns back it is at rest for a moment, too."""
            newest_s = stamp_s(self._received[-1])
            states = [
                state for state in self._received[-500:] if stamp_s(state) > newest_s - REST_S
            ]
            fastest = max(max(map(abs, state.velocity[:6])) for state in states)
            return newest_s > ended_s + REST_S and fastest < 1e-3

        wait_until(at_rest, "standstill")
        return Jog.of(messages)


@contextmanager
def nothing_is_rejected(process: RobotProcess, arm: Arm) -> Iterator[None]:
    printed = len(process.output)
    yield
    for line in process.output[printed:].splitlines():
        # Servo halts by the velocity that makes up for an old state, or a late turn, in one period.
        is_made_up_for = arm.oldest_s > OLD_S and "is clipped" in line
        assert "[info" in line or is_made_up_for, line


def there_and_back(time_s: float) -> float | None:
    """Command joint 1 to move to and fro, and end."""
    if time_s > 2.0:
        return None
    return SPEED if time_s < 1.0 else -SPEED


@pytest.fixture(scope="module")
def robot() -> Iterator[RobotProcess]:
    """An arm whose time-out outlasts a stall of this process, between two messages."""
    with RobotProcess("--set", "stream.timeout_s=3") as process:
        process.wait_ready()
        yield process


@pytest.fixture(scope="module")
def arm(robot: RobotProcess) -> Iterator[Arm]:
    with connected(robot) as client:
        yield Arm(client)


def test_the_arm_ends_where_servo_halts_and_nothing_is_rejected(
    arm: Arm, robot: RobotProcess
) -> None:
    """Judge the end only: ``test_servo_windows.py`` judges in simulated time how it follows."""
    with nothing_is_rejected(robot, arm):
        jog = arm.run(ServoEmulator(), there_and_back, 2.4)
    assert len(jog.messages) > 200
    assert arm.position == pytest.approx(jog.states[-1, 1:], abs=1e-3)


def test_the_arm_stops_by_the_time_out_when_messages_end_in_motion(arm: Arm) -> None:
    jog = arm.run(ServoEmulator(use_smoothing=False), lambda _: SPEED, 1.0)
    assert jog.messages[-1].velocity[-1][0] > 0.0  # less than SPEED where this process was late
    arm.run(ServoEmulator(use_smoothing=False), lambda _: -SPEED, 1.0)
