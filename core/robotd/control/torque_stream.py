"""Torque streams: torques of joints that a client decides while they move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import Clock
from robotd.control.joint_motion import JointMotion
from robotd.control.open_stream import (
    OpenStream,
    StreamChecks,
    StreamClient,
    chosen_columns,
    chosen_timeout,
)
from robotd.control.rearming import CommandSource, Rearming
from robotd.control.torque_motion import TorqueMotion
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, NotReady
from robotd.motion import JointLimits

OWNER = "torque stream"
NEUTRAL = "torques of 0, which are not applied"
_UNITS = {"rad": "N·m", "m": "N"}


class TorqueChecks(StreamChecks):
    """Checks of torques of some joints."""

    def admit(self, torque: Sequence[float]) -> FloatArray | None:
        """Check and admit as ``TorqueStream.send``; return it as an array.

        None: torques of 0 that arm the source. They are not applied: an arm would fall.
        """
        values = self.values("torque", torque)
        admission = self.source.admit(moves=bool(values.any()))
        return None if admission.only_arms else values

    def send(self, torque: Sequence[float], *, sent_ns: int | None = None) -> None:
        """Check and admit a command that a stream is opened for. Raises as ``admit``."""
        if self.admit(torque) is None:
            raise NotReady("torques of 0 allow the next command, and are not applied")


class TorqueStream(OpenStream[TorqueMotion]):
    """Open torque stream of some joints, made by ``Robot.torque_stream``; a context.

    Gravity, friction and contact are the client's: at a torque of 0 an arm falls.

    Args:
        checks: of its commands.
        units: of their torques, "N·m" or "N".
        limit: (k,) highest torque of each.
        motion: applies the torques.
        release: stops ``motion`` and gives the joints back.
        clock: of the control loop.
    """

    def __init__(
        self,
        checks: TorqueChecks,
        units: Sequence[str],
        limit: FloatArray,
        motion: TorqueMotion,
        release: Callable[[TorqueMotion], None],
        clock: Clock,
    ) -> None:
        super().__init__(checks, motion, release)
        self._checks = checks
        self._units, self._limit, self._clock = tuple(units), limit, clock

    def send(self, torque: Sequence[float], *, sent_ns: int | None = None) -> None:
        """Apply ``torque`` until the next command; beyond a limit it is clipped and counted.

        Never blocks. Any thread.

        Args:
            torque: one for each of ``joints``, in N·m or N.
            sent_ns: time of the command on the robot's clock, from which its age counts; None: now.

        Raises:
            InvalidArgument: a wrong number of values, or one that is not finite.
            NotReady: the stream has ended, or its client went on commanding while motion was
                rejected and has to begin anew; with the reason.
        """
        self._require_open()
        values = self._checks.admit(torque)
        self._commands += 1
        if values is None:
            return
        clipped = self._clip("torque", values, -self._limit, self._limit, self._units)
        self._motion.put(clipped, self._clock.now_ns() if sent_ns is None else sent_ns)


class TorqueStreams:
    """Opens torque streams of the joints of a group, one at a time.

    Called like a function, by worker threads.

    Args:
        motion: of the joints.
        axes: of the robot.
        descriptor: joints of the group, and time-outs.
        limits: of the joints.
        clock: of the control loop.
        driver: applies the torques.
        rearming: of the robot.
    """

    def __init__(
        self,
        motion: JointMotion,
        axes: Axes,
        descriptor: RobotDescriptor,
        limits: JointLimits,
        clock: Clock,
        driver: AxisDriver,
        rearming: Rearming,
    ) -> None:
        self._rearming = rearming
        self._motion, self._axes, self._limits = motion, axes, limits
        self._joints, self._timeout_s = descriptor.joints, descriptor.stream.timeout_s
        self._clock, self._driver = clock, driver
        self._stopped_velocity = limits.stopped_velocity(descriptor.trajectory)

    def __call__(
        self,
        joints: Sequence[str] | None = None,
        *,
        timeout_s: float | None = None,
        owner: str = OWNER,
        source: CommandSource | None = None,
    ) -> TorqueStream:
        """Return an open stream of joints at rest; until its first command each torque stays.

        It begins with the torque that holds the joints, and ends in position control: when it is
        closed, without a command for ``timeout_s``, when a joint exceeds its velocity limit or
        comes so close to a position limit that it has to brake. Other joints hold their positions.

        Args:
            joints: in the order of the values to send; None: all.
            timeout_s: age of the last command at which it ends; None: the descriptor's.
            owner: name of the client, for those who ask for the same joints.
            source: of the commands; None: that of ``owner``.

        Raises:
            InvalidArgument: unknown joint, one without a torque limit, or a time-out that is not
                positive.
            NotReady: a joint moves, cannot be commanded now, or has another owner.
            Unsupported: the backend takes no torques.
        """
        chosen = chosen_columns(joints, self._limits.names)
        limit = self._torque_limits(chosen)
        seconds = chosen_timeout(timeout_s, self._timeout_s)
        axes = np.array([self._joints[column].axis for column in chosen], np.int64)
        source = source or self._rearming.find(self._source(owner, axes, seconds))
        source.begin()
        self._axes.speed.at_start()
        limits = self._limits.of(chosen)
        make = partial(
            TorqueMotion,
            self._driver,
            self._axes.stops,
            axes,
            limits,
            timeout_s=seconds,
            stopped_velocity=self._stopped_velocity[chosen],
            speed=self._axes.speed,
            feedback_period_s=self._axes.feedback_period_s,
        )

        def watched(start_ns: int) -> TorqueMotion:
            motion = make(start_ns)
            self._rearming.interruptions.watch(motion.completion, source.axes)
            return motion

        motion = self._motion.start_alone(axes.tolist(), CommandMode.TORQUE, watched, owner)
        units = [_UNITS[unit] for unit in limits.units]
        checks = TorqueChecks(limits.names, source)
        return TorqueStream(checks, units, limit, motion, self._motion.release, self._clock)

    def _source(self, name: str, axes: IntArray, timeout_s: float) -> CommandSource:
        return CommandSource(
            self._rearming, name, axes.tolist(), (), timeout_s=timeout_s, neutral=NEUTRAL
        )

    def client(self, owner: str, timeout_s: float) -> StreamClient[TorqueStream]:
        """Return a client for all joints whose streams end ``timeout_s`` after its last command."""
        axes = np.array([joint.axis for joint in self._joints], np.int64)
        source = self._source(owner, axes, timeout_s)
        open_stream = partial(self, timeout_s=timeout_s, owner=owner, source=source)
        return StreamClient(TorqueChecks(self._limits.names, source), open_stream)

    def _torque_limits(self, chosen: IntArray) -> FloatArray:
        limits = []
        for column in chosen:
            joint = self._joints[column]
            if joint.effort_limit is None:
                key = joint.key("torque_limit_nm")
                raise InvalidArgument(
                    f"{joint.name}: no torque limit; a torque stream needs"
                    f" joints.{column}.{key} in the robot's file"
                )
            limits.append(joint.effort_limit)
        return np.array(limits, np.float64)
