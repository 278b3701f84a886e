"""Torque streams of a robot on real bus frames; shared by the tests of two fieldbuses.

The robot has the joints ``shoulder`` and ``elbow`` with torque limits of 10 N·m. Its simulated
motors have inertia and friction, no gravity.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from robotd.clock import MonotonicClock, wait_until
from robotd.control.groups.torque_stream import TorqueStream
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation
from robotd.errors import InvalidArgument, NotReady
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot

PATIENCE_S = 15.0
SEND_S = 0.004
QUICK_STOP_RAD_S2 = 40.0  # of the drives, by default


def until(condition: Callable[[], object]) -> None:
    assert wait_until(lambda: bool(condition()), PATIENCE_S, MonotonicClock())


@contextmanager
def sending(stream: TorqueStream, *torque: float) -> Iterator[None]:
    """Send ``torque`` again and again during the block, until the stream ends.

    It begins with no torque, as after a stop or fault a client has to.
    """
    ending = threading.Event()
    stream.send([0.0] * len(torque))

    def send() -> None:
        while not ending.wait(SEND_S):
            try:
                stream.send(torque)
            except NotReady:
                return

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()


class Watch:
    """Velocities of the first joint in each control period."""

    def __init__(self, robot: Robot) -> None:
        self._rows: list[tuple[int, float, float]] = []
        robot.control_loop.every(2000, "watch", self._note)

    def _note(self, image: ProcessImage) -> None:
        row = image.fresh_ns, float(image.position[0]), float(image.velocity[0])
        if not self._rows or row[0] != self._rows[-1][0]:
            self._rows.append(row)

    def clear(self) -> None:
        self._rows.clear()

    @property
    def steepest(self) -> float:
        """Largest mean acceleration over three frames, rad/s²: stalls move single ones."""
        time_ns, _, velocity = np.array(self._rows).T
        return float(
            np.abs((velocity[3:] - velocity[:-3]) / (time_ns[3:] - time_ns[:-3]) * 1e9).max()
        )

    @property
    def fastest(self) -> float:
        return max(velocity for _, _, velocity in self._rows)

    @property
    def highest(self) -> float:
        return max(position for _, position, _ in self._rows)


def at_rest(robot: Robot) -> bool:
    return bool(np.abs(robot.image.velocity[:2]).max() < 1e-3)


def in_position_mode(robot: Robot) -> bool:
    image = robot.image
    idle = (image.operation[:2] == Operation.IDLE).all()
    return bool(idle and (image.mode[:2] == CommandMode.POSITION).all())


def a_torque_moves_one_joint_and_the_other_holds(robot: Robot) -> None:
    watch, elbow = Watch(robot), float(robot.image.position[1])
    with robot.torque_stream(["shoulder"], timeout_s=PATIENCE_S) as stream:
        assert robot.axes.owner(0) == "torque stream"
        with sending(stream, 6.0):
            until(lambda: robot.image.velocity[0] > 0.5)
            assert robot.image.torque[0] == pytest.approx(6.0, abs=1.0)
            with (
                pytest.raises(NotReady, match="in use by torque stream"),
                robot.follower.follow(request(robot, 1.0, 0.0)),
            ):
                pass
    assert stream.message == "closed by the client"
    until(lambda: at_rest(robot))
    assert in_position_mode(robot)
    assert robot.image.position[1] == pytest.approx(elbow, abs=1e-4)
    assert watch.steepest < 1.5 * QUICK_STOP_RAD_S2
    with robot.follower.follow(request(robot, 1.0, 0.1)) as execution:
        assert execution.wait(PATIENCE_S)
    assert execution.outcome is Outcome.SUCCEEDED


def a_lost_source_stops_the_joints(robot: Robot) -> None:
    with robot.torque_stream(timeout_s=0.2) as stream:
        with sending(stream, 6.0, -6.0):
            until(lambda: robot.image.velocity[0] > 0.3)
        assert stream.wait(PATIENCE_S)
        assert stream.message == "no command for 0.2 s"
        until(lambda: at_rest(robot))
        with pytest.raises(NotReady, match=r"the stream has ended: no command for 0\.2 s"):
            stream.send([1.0, 1.0])
    assert in_position_mode(robot)


def the_velocity_limit_ends_the_stream(robot: Robot) -> None:
    with robot.torque_stream(timeout_s=PATIENCE_S) as stream, sending(stream, 50.0, 0.0):
        assert stream.wait(PATIENCE_S)
        assert "its velocity limit is 3 rad/s" in stream.message
        until(lambda: at_rest(robot))
        assert stream.clipped > 0


def the_speed_of_all_motion_bounds_it(robot: Robot) -> None:
    watch = Watch(robot)
    robot.set_speed(0.2)
    try:
        # 1.2 N·m above friction: a stall of 0.1 s on the way to 0.6 rad/s does not lead beyond it.
        with robot.torque_stream(timeout_s=PATIENCE_S) as stream, sending(stream, 3.2, 0.0):
            until(lambda: robot.image.velocity[0] > 0.45)
            watch.clear()
            passed = float(robot.image.position[0]) + 0.3
            until(lambda: robot.image.position[0] > passed or not stream.open)
            assert stream.open, stream.message
            assert watch.fastest <= 0.6  # of 3 rad/s
            robot.set_speed(0.1)  # it is faster than that
            assert stream.wait(PATIENCE_S)
            assert "its velocity limit at a speed of 10 % is 0.3 rad/s" in stream.message
            until(lambda: at_rest(robot))
    finally:
        robot.set_speed(1.0)


def a_joint_brakes_before_its_position_limit(robot: Robot) -> None:
    watch = Watch(robot)
    with robot.torque_stream(timeout_s=PATIENCE_S) as stream, sending(stream, 4.0, 0.0):
        assert stream.wait(PATIENCE_S)
    assert "too close to its limit 3 rad" in stream.message, stream.message
    until(lambda: at_rest(robot))
    assert watch.highest < 3.0


def a_stop_of_the_robot_ends_the_stream(robot: Robot) -> None:
    with robot.torque_stream(timeout_s=PATIENCE_S) as stream, sending(stream, 6.0, 0.0):
        until(lambda: robot.image.velocity[0] > 0.3)
        robot.stop("for a test")
        assert stream.message == "stopped: for a test"
        until(lambda: at_rest(robot))
    with pytest.raises(NotReady, match="for a test"):
        robot.torque_stream()
    assert in_position_mode(robot)
    robot.reset()


def bad_commands_move_nothing(robot: Robot) -> None:
    with pytest.raises(InvalidArgument, match="joint hip is unknown"):
        robot.torque_stream(["hip"])
    with robot.torque_stream(timeout_s=PATIENCE_S) as stream:
        with pytest.raises(InvalidArgument, match="torque: 1 values for 2 joints"):
            stream.send([1.0])
        with pytest.raises(InvalidArgument, match="shoulder: torque is nan"):
            stream.send([float("nan"), 0.0])
    until(lambda: at_rest(robot))


def a_shutdown_in_motion_stops_first(robot: Robot) -> None:
    """Last of all: the robot is shut down."""
    watch = Watch(robot)
    stream = robot.torque_stream(timeout_s=PATIENCE_S)
    with sending(stream, 6.0, 0.0):
        until(lambda: robot.image.velocity[0] > 0.3)
        watch.clear()
        robot.shutdown()
    assert not stream.open
    assert watch.steepest < 1.5 * QUICK_STOP_RAD_S2


def request(robot: Robot, seconds: float, target: float) -> TrajectoryRequest:
    names = robot.joint_names
    return TrajectoryRequest.from_rows(names, [seconds], [[target] * len(names)])


CHECKS = (
    a_torque_moves_one_joint_and_the_other_holds,
    a_lost_source_stops_the_joints,
    the_velocity_limit_ends_the_stream,
    the_speed_of_all_motion_bounds_it,
    a_joint_brakes_before_its_position_limit,
    a_stop_of_the_robot_ends_the_stream,
    bad_commands_move_nothing,
    a_shutdown_in_motion_stops_first,
)
