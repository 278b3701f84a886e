"""A base that is driven over its topics, and the distance by its wheels."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger
from tests.ros.robot_process import Client, stamp_s, wait_until
from wmx_ros2_message.msg import AxisState

RADIUS_M, SEPARATION_M = 0.09, 0.55
PERIOD_S = 0.05  # between two commands
LAPSE_S = 0.2  # without a command: the drives stop after 0.25 s, the base after 0.5 s


@dataclass(frozen=True)
class Leg:
    """One motion of the base, from rest to rest.

    A command is in force from some moment between its publication and its echo, and the first one
    at the latest when the base moves.

    Attributes:
        least_s, most_s: for how long the command was in force; least 0.0: it may have lapsed.
        stood_s: for how long the robot stood still meanwhile, with the whole computer.
        states: of the axes meanwhile.
    """

    least_s: float
    most_s: float
    stood_s: float
    states: list[Any]


class Base:
    """Client of the base: commands and received messages.

    Attributes:
        sent: time of each command; its index is in the unused ``linear.z``, and so in its echo.
        echoed: time at which each index came back: the base has had the command by then.
        moving: times at which the base was seen to move.
    """

    def __init__(self, client: Client) -> None:
        self._client = client
        self._publisher = client.publisher(Twist, "/cmd_vel")
        self.sent: list[float] = []
        self.echoed: dict[int, float] = {}
        self.moving: list[float] = []
        self.echo = client.listen(Twist, "/cmd_vel_check")
        client.node.create_subscription(Twist, "/cmd_vel_check", self._note_echo, 10)
        self.odometry = client.listen(Odometry, "/odom_enc")
        client.node.create_subscription(Odometry, "/odom_enc", self._note_motion, 10)
        self.axes = client.listen(AxisState, "/wmx/axis/state")
        wait_until(lambda: client.node.count_publishers("/cmd_vel_check"), "the echo")
        client.next(self.odometry)

    def _note_echo(self, twist: Twist) -> None:
        self.echoed[int(twist.linear.z)] = time.monotonic()

    def _note_motion(self, odometry: Odometry) -> None:
        if self.moves(odometry, 1e-3):
            self.moving.append(time.monotonic())

    @staticmethod
    def moves(odometry: Odometry, more_than: float) -> bool:
        twist = odometry.twist.twist
        return abs(twist.linear.x) + abs(twist.angular.z) > more_than

    @property
    def speed(self) -> float:
        return float(self.odometry[-1].twist.twist.linear.x)

    @property
    def pose(self) -> tuple[float, float, float]:
        pose = self.odometry[-1].pose.pose
        heading = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
        return pose.position.x, pose.position.y, heading

    def command(self, linear: float, angular: float) -> None:
        twist = Twist()
        twist.linear.x, twist.angular.z = linear, angular
        twist.linear.z = float(len(self.sent))
        self.sent.append(time.monotonic())
        self._publisher.publish(twist)

    def drive(self, linear: float, angular: float, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.command(linear, angular)
            time.sleep(min(PERIOD_S, max(0.0, end - time.monotonic())))

    @contextmanager
    def driving(self, linear: float, angular: float) -> Iterator[None]:
        """Command on in the block, also while a service answers."""
        ended = threading.Event()

        def command_on() -> None:
            while not ended.wait(PERIOD_S):
                self.command(linear, angular)

        thread = threading.Thread(target=command_on)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def longest_silence_s(self, first: int) -> float:
        """Return the longest time between two commands since the one with index ``first``."""
        return max(later - earlier for earlier, later in pairwise(self.sent[first:]))

    def stands(self, messages: int = 50) -> bool:
        """Return whether it is at rest in each of the next messages of the odometry."""
        first = len(self.odometry)
        wait_until(lambda: len(self.odometry) >= first + messages, "odometry")
        return not any(self.moves(message, 1e-9) for message in self.odometry[first:])

    def drive_and_rest(self, linear: float, angular: float, seconds: float) -> Leg:
        """Drive, stop, and wait until the base is at rest."""
        start, first = len(self.axes) - 1, len(self.sent)
        self.drive(linear, angular, seconds)
        last = len(self.sent)
        self.rest()
        wait_until(lambda: max(self.echoed) >= last, "the echo of the stop")
        echoed = sorted(index for index in self.echoed if index >= first)
        stop = next(index for index in echoed if index >= last)
        gaps = (self.echoed[later] - self.sent[earlier] for earlier, later in pairwise(echoed))
        moving_s = next(time_s for time_s in self.moving if time_s > self.sent[first])
        states = self.axes[start:]
        between = (stamp_s(later) - stamp_s(earlier) for earlier, later in pairwise(states))
        return Leg(
            0.0 if max(gaps) > LAPSE_S else self.sent[last] - moving_s,
            self.echoed[stop] - self.sent[first],
            sum(gap_s for gap_s in between if gap_s > LAPSE_S),
            states,
        )

    def rest(self) -> None:
        self.command(0.0, 0.0)
        wait_until(lambda: not self.moves(self.odometry[-1], 1e-9), "at rest")
        self._client.next(self.odometry)
        self._client.next(self.axes)

    def reset(self) -> None:
        self.rest()
        answer = self._client.call(Trigger, "/diff_drive_controller/reset_odometry")
        assert answer.success, answer.message
        self._client.next(self.odometry)


def along(steps: Iterable[tuple[float, float]]) -> tuple[float, float, float, float]:
    """x, y, heading and distance after steps of (length, turn)."""
    x = y = heading = distance = 0.0
    for length, turn in steps:
        x += length * math.cos(heading + turn / 2)
        y += length * math.sin(heading + turn / 2)
        heading, distance = heading + turn, distance + abs(length)
    return x, y, heading, distance


def wheels_say(states: list[Any]) -> Iterator[tuple[float, float]]:
    """Steps by the true wheel positions, from one state to the next."""
    for before, after in pairwise(states):
        left, right = (RADIUS_M * (after.actual_pos[a] - before.actual_pos[a]) for a in (0, 1))
        yield (left + right) / 2, (right - left) / SEPARATION_M
