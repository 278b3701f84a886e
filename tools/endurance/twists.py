"""Twists for a mobile base: a new one at random each second, sent at a rate, and pauses."""

from __future__ import annotations

import random
import threading
from collections import Counter

from geometry_msgs.msg import Twist
from tests.ros.robot_process import Client
from tools.endurance.pace import Pace

from robotd.descriptor import RobotDescriptor

SPEED_M_S, TURN_RAD_S = 0.3, 0.5
CHANGE, PAUSE = 0.05, 0.2  # of a message; of a change


class Twists:
    """Publishes ``rate_hz`` twists a second. Counts ``twists``."""

    def __init__(
        self,
        client: Client,
        descriptor: RobotDescriptor,
        counts: Counter[str],
        chance: random.Random,
        rate_hz: float,
    ) -> None:
        parameters = descriptor.ros_parameters["diff_drive_controller"]
        self._publisher = client.publisher(Twist, f"/{parameters['cmd_vel_topic']}")
        self._counts, self._chance = counts, chance
        self._pace = Pace(rate_hz)

    def run(self, ended: threading.Event) -> None:
        twist, chance = Twist(), self._chance
        while self._pace.wait(ended):
            if chance.random() < CHANGE:
                twist.linear.x = chance.uniform(-SPEED_M_S, SPEED_M_S)
                twist.angular.z = chance.uniform(-TURN_RAD_S, TURN_RAD_S)
                if chance.random() < PAUSE:
                    ended.wait(chance.uniform(0.0, 2.0))
            self._publisher.publish(twist)
            self._counts["twists"] += 1
