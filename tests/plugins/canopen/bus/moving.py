"""Robot that moves until it is killed.

``python -m tests.plugins.canopen.bus.moving FILE MOTION [BACKEND]``

A line is printed when every joint moves at ``SPEED_RAD_S``.
"""

# ruff: noqa: T201 - output for the parent process

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum

import numpy as np

from robotd.clock import NANOSECONDS, wait_until
from robotd.device.axes import Jog
from robotd.device.state import CommandMode
from robotd.motion import TrajectoryRequest
from robotd.motion.profile import Profile
from robotd.robot import Robot, open_robot

SPEED_RAD_S = 0.5
RAMP_RAD_S2 = 2.0
LONG_S = 4.0  # of motion, far more than is needed


class Motion(StrEnum):
    """Source of the motion: setpoints of robotd, or ramps of the drives."""

    STREAMED = "streamed"
    VELOCITY = "velocity"


@contextmanager
def moving(robot: Robot, motion: Motion) -> Iterator[None]:
    """All joints move for some seconds."""
    names = robot.joint_names
    if motion is Motion.STREAMED:
        end = [SPEED_RAD_S * LONG_S] * len(names)
        with robot.follower.follow(TrajectoryRequest.from_rows(names, [LONG_S], [end])):
            yield
        return
    axes = range(len(names))
    for axis in axes:
        robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    robot.axes.jog([Jog(axis, Profile(SPEED_RAD_S, RAMP_RAD_S2, RAMP_RAD_S2)) for axis in axes])
    yield


def main(path: str, motion: str, backend: str = "canopen") -> None:
    """Move until the process is killed."""
    with open_robot(path, backend) as robot, moving(robot, Motion(motion)):
        clock, image = robot.clock, robot.image
        fast = 0.99 * SPEED_RAD_S
        if wait_until(lambda: np.abs(image.velocity).min() > fast, LONG_S, clock):
            print("moving", flush=True)
            clock.sleep_until_ns(clock.now_ns() + round(LONG_S * NANOSECONDS))


if __name__ == "__main__":
    main(*sys.argv[1:])
