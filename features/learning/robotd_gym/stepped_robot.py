"""Simulated robot that is streamed to in simulated time, for environments."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from robotd.api import FloatArray, InvalidArgument, NotReady
from robotd.api.models import load_robot_descriptor, parse_override
from robotd.api.robots import JointStream, Robot, SteppedClock, StreamMode, load_backend

BACKEND = "sim"
SILENT_PERIODS = 10  # without a target, after which the joints slow to rest


def finite_numbers(values: ArrayLike, count: int, what: str) -> FloatArray:
    """Return an array of ``count`` finite numbers. Raises InvalidArgument: it is none."""
    numbers = np.asarray(values, np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise InvalidArgument(f"{what} is {numbers.tolist()}, must be {count} finite numbers")
    return numbers


def positive_number(value: float, what: str) -> float:
    """Return a number above 0. Raises InvalidArgument: it is none."""
    if not 0.0 < value < np.inf:
        raise InvalidArgument(f"{what} is {value:g}, must be above 0")
    return value


class SteppedRobot:
    """Robot on the simulation that moves by one target of all joints per step.

    Time passes in ``step`` only, as fast as the computer allows. One thread. Two robots with the
    same seed and the same targets move alike, bit for bit.

    Args:
        robot: name of a robot, or path of its ``robot.yaml``.
        variant: of the descriptor; None: its default.
        rate_hz: of the targets; the rate of the control loop is a multiple of it.
        backend: a simulated one, whose section has the key ``seed``.

    Attributes:
        joint_names: of all joints, in the order of every array.
        lower, upper: (n,) position limits in rad or m; infinite where there is none.
        velocity_limits: (n,) in rad/s or m/s.
        period_s: simulated time of a step.

    Raises:
        DescriptorError: the robot is unknown or its file is wrong.
        InvalidArgument: it has no joints, or ``rate_hz`` does not divide the loop's rate.
    """

    def __init__(
        self,
        robot: str | Path = "cr3a",
        variant: str | None = None,
        rate_hz: float = 25.0,
        backend: str = BACKEND,
    ) -> None:
        self._name, self._variant, self._backend = robot, variant, backend
        descriptor = load_robot_descriptor(robot, variant)
        loop_hz = descriptor.cycle.rate_hz
        self._periods = round(loop_hz / rate_hz) if rate_hz > 0.0 else 0
        if not descriptor.joints:
            raise InvalidArgument(f"{descriptor.name} has no joints")
        if self._periods < 1 or abs(self._periods * rate_hz - loop_hz) > 1e-6 * loop_hz:
            raise InvalidArgument(
                f"rate_hz is {rate_hz:g}: the control loop's {loop_hz:g} Hz must be a multiple"
            )
        joints = descriptor.joints
        self.joint_names = descriptor.joint_names
        self.lower = np.array([joint.lower for joint in joints])
        self.upper = np.array([joint.upper for joint in joints])
        self.velocity_limits = np.array([joint.velocity for joint in joints])
        self.period_s = 1.0 / rate_hz
        self._axes = [joint.axis for joint in joints]
        self._robot: Robot | None = None
        self._streams: list[tuple[JointStream, list[int]]] = []
        self._open = ExitStack()

    def reset(self, seed: int = 0) -> None:
        """Start a new robot at its initial position; ``seed`` is that of the simulated noise."""
        self.close()
        seeded = parse_override(f"backends.{self._backend}.seed={seed}")
        descriptor = load_robot_descriptor(self._name, self._variant, overrides=[seeded])
        robot = Robot(descriptor, load_backend(self._backend), SteppedClock())
        self._open.callback(robot.shutdown)
        robot.start()
        self._robot, self._streams = robot, []
        for group in robot.groups.values():
            stream = group.stream(
                mode=StreamMode.SMOOTH, timeout_s=SILENT_PERIODS * self.period_s, owner="gymnasium"
            )
            self._open.callback(stream.close)
            columns = [self.joint_names.index(name) for name in group.joint_names]
            self._streams.append((stream, columns))

    @property
    def robot(self) -> Robot:
        """The robot since ``reset``, for faults, I/O and events. Raises NotReady before."""
        if self._robot is None:
            raise NotReady("the environment has not been reset")
        return self._robot

    @property
    def position(self) -> FloatArray:
        """(n,) measured positions in rad or m, a copy."""
        return self.robot.image.position[self._axes]

    @property
    def velocity(self) -> FloatArray:
        """(n,) measured velocities in rad/s or m/s, a copy."""
        return self.robot.image.velocity[self._axes]

    def step(self, target: Sequence[float] | FloatArray) -> None:
        """Send ``target`` (n,), in rad or m, and let one period of the targets pass.

        Raises:
            InvalidArgument: a wrong number of values, or one that is not finite.
            NotReady: before ``reset``, or the stream has ended; with the reason.
        """
        values = np.asarray(target, np.float64)
        if values.shape != (len(self.joint_names),):
            raise InvalidArgument(f"{values.size} values for {len(self.joint_names)} joints")
        if not np.isfinite(values).all():  # before the first of several streams moves
            raise InvalidArgument(f"target {values.tolist()} must be finite numbers")
        for stream, columns in self._streams:
            stream.send(values[columns].tolist())
        self.robot.step(self._periods)

    def close(self) -> None:
        """Bring the joints to rest and shut the robot down. Idempotent."""
        self._robot, self._streams = None, []
        self._open.close()
