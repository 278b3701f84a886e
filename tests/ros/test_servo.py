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
from tests.ros.servo_emulator import Jog, Message, ServoEmulator, TrajectoryController
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS

pytestmark = pytest.mark.ros

NAMES = [f"joint{number}" for number in range(1, 7)]
TOPIC = "/movensys_manipulator_arm_controller/joint_trajectory"
SPEED = 0.3
BEYOND_PEER = (
    0.1  # rad: a third of a second late, in real time; in simulated time: test_servo_windows.py
)


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
        wait_until(lambda: self._received, "joint states")

    @property
    def position(self) -> FloatArray:
        return np.array(self._received[-1].position[:6])

    def run(
        self,
        servo: ServoEmulator,
        velocity: Callable[[float], float | None],
        duration_s: float,
        jitter_s: float = 0.0,
    ) -> Run:
        """Jog joint 1 with ``velocity``, joint 2 the other way, then wait for standstill.

        Where ``velocity`` is None, the commands have ended, and Servo halts.
        """
        began, messages = len(self._received), []
        late = np.random.default_rng(1)
        began_s = due_s = time.time()
        peer = TrajectoryController(self.position)
        sampled: list[FloatArray] = []
        while due_s < began_s + duration_s:
            time.sleep(max(0.0, due_s + late.uniform(0.0, jitter_s) - time.time()))
            now_s = time.time()
            due_s += servo.publish_period
            if now_s > due_s + servo.publish_period:  # as rclcpp::Rate after a missed cycle
                due_s = now_s + servo.publish_period
            speed = velocity(now_s - began_s)
            if speed is None:
                message = servo.halt(now_s, self.position)
            else:
                speeds = [speed, -speed / 2, 0.0, 0.0, 0.0, 0.0]
                message = servo.jog(now_s, speeds, self.position)
            sampled.append(np.array([now_s, *peer.at(now_s)[0]]))
            if message is not None:
                self._publisher.publish(ros_message(message))
                messages.append(message)
                peer.take(message, now_s)

        def at_rest() -> bool:
            return max(map(abs, self._received[-1].velocity[:6])) < 1e-3

        wait_until(at_rest, "standstill")
        time_s = time.time()
        wait_until(lambda: stamp_s(self._received[-1]) > time_s, "a state at rest")
        return Run(Jog.of(messages), self._received[began:], np.array(sampled))


class Run:
    """Jog and the motion of the arm."""

    def __init__(self, jog: Jog, states: list[Any], peer: FloatArray) -> None:
        self.jog, self.peer = jog, peer
        self.position = np.array([[stamp_s(each), *each.position[:6]] for each in states])


@contextmanager
def nothing_is_rejected(process: RobotProcess) -> Iterator[None]:
    printed = len(process.output)
    yield
    for line in process.output[printed:].splitlines():
        assert "[info" in line, line


def there_and_back(time_s: float) -> float | None:
    """Command joint 1 to move to and fro, and end."""
    if time_s > 2.0:
        return None
    return SPEED if time_s < 1.0 else -SPEED


def test_the_arm_follows_servo_as_its_peer_does() -> None:
    # The time-out is longer than a stall of this process, whose messages would end the stream.
    with RobotProcess("--set", "stream.timeout_s=2") as process:
        process.wait_ready()
        with connected(process) as client, nothing_is_rejected(process):
            run = Arm(client).run(ServoEmulator(), there_and_back, 2.4)
    error, of_peer = run.jog.largest_error(run.position), run.jog.largest_error(run.peer)
    assert error <= of_peer + BEYOND_PEER
    assert run.position[-1, 1:] == pytest.approx(run.jog.states[-1, 1:], abs=1e-3)


@pytest.mark.daily
def test_the_arm_stops_by_the_time_out_when_messages_end_in_motion(client: Client) -> None:
    arm = Arm(client)
    run = arm.run(ServoEmulator(use_smoothing=False), lambda _: SPEED, 1.0)
    assert run.jog.messages[-1].velocity[-1][0] == pytest.approx(SPEED, rel=0.5)
    arm.run(ServoEmulator(use_smoothing=False), lambda _: -SPEED, 1.0)
