"""Torque streams: torques of joints that a client decides, within limits of the motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.control.groups.streams import (
    OpenStream,
    StreamClient,
    StreamCommands,
    StreamOpener,
    chosen_columns,
    chosen_timeout,
)
from robotd.control.loop.rearming import CommandSource
from robotd.control.sources.torque_source import TorqueMotion
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, NotReady

OWNER = "torque stream"
NEUTRAL = "torques of 0, which are not applied"
_UNITS = {"rad": "N·m", "m": "N"}


class TorqueCommand(NamedTuple):
    """Command of a torque stream.

    Attributes:
        torque: (k,) N·m or N; None: torques of 0 that have armed their source. They are not
            applied: an arm would fall.
        time_ns: at which it was sent.
    """

    torque: FloatArray | None
    time_ns: int


class TorqueCommands(StreamCommands):
    """Commands of torques to some joints."""

    def torque(self, torque: Sequence[float], *, sent_ns: int | None = None) -> TorqueCommand:
        """Return the command of ``TorqueStream.send``, which raises the same."""
        values = self._values("torque", torque)
        admission = self.source.admit(moves=bool(values.any()))
        return TorqueCommand(None if admission.only_arms else values, self._time_ns(sent_ns))

    def check_opening(self, command: TorqueCommand) -> None:
        if command.torque is None:
            raise NotReady("torques of 0 allow the next command, and are not applied")


class TorqueStream(OpenStream[TorqueMotion]):
    """Open torque stream of some joints, made by ``Robot.torque_stream``; a context.

    Gravity, friction and contact are the client's: at a torque of 0 an arm falls.

    Args:
        units: of their torques, "N·m" or "N".
        limit: (k,) highest torque of each.
        release: stops ``motion`` and gives the joints back.
    """

    def __init__(
        self,
        commands: TorqueCommands,
        units: Sequence[str],
        limit: FloatArray,
        motion: TorqueMotion,
        release: Callable[[TorqueMotion], None],
    ) -> None:
        super().__init__(commands, motion, release)
        self._commands, self._units, self._limit = commands, tuple(units), limit

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
        self.put(self._commands.torque(torque, sent_ns=sent_ns))

    def put(self, command: TorqueCommand) -> None:
        """Apply a command, within the limits."""
        self._require_open()
        self._received += 1
        if command.torque is not None:
            clipped = self._clip("torque", command.torque, -self._limit, self._limit, self._units)
            self._motion.put(clipped, command.time_ns)


class TorqueStreams(StreamOpener):
    """Opens torque streams of the joints of a group, one at a time."""

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
            NotReady: a joint moves, cannot be commanded now, or has another owner, or the group
                has a limit of its speed.
            Unsupported: the backend takes no torques.
        """
        chosen = chosen_columns(joints, self._limits.names)
        limit = self._torque_limits(chosen)
        seconds = chosen_timeout(timeout_s, self._settings.timeout_s)
        axes = np.array(self._joint_axes, np.int64)[chosen]
        source = source or self._rearming.find(self._source(owner, axes.tolist(), seconds))
        source.begin()
        self._axes.speed.at_start()
        if reason := self._motion_limits.reason:
            raise NotReady(f"{reason}; torques cannot keep it")
        limits = self._limits.of(chosen)

        def make(start_ns: int) -> TorqueMotion:
            motion = TorqueMotion(
                self._driver,
                self._axes,
                axes,
                limits,
                start_ns,
                seconds,
                self._rules.stopped_velocity[chosen],
                self._motion_limits,
            )
            self._rearming.interruptions.watch(motion.completion, source.axes)
            return motion

        motion = self._motion.start_alone(axes.tolist(), CommandMode.TORQUE, make, owner)
        units = [_UNITS[unit] for unit in limits.units]
        commands = TorqueCommands(limits.names, source, self._axes.clock)
        return TorqueStream(commands, units, limit, motion, self._motion.release)

    def _source(self, name: str, axes: Sequence[int], timeout_s: float) -> CommandSource:
        return CommandSource(self._rearming, name, axes, (), timeout_s=timeout_s, neutral=NEUTRAL)

    def client(self, owner: str, timeout_s: float) -> StreamClient[TorqueStream]:
        """Return a client for all joints whose streams end ``timeout_s`` after its last command."""
        source = self._source(owner, self._joint_axes, timeout_s)
        open_stream = partial(self, timeout_s=timeout_s, owner=owner, source=source)
        return StreamClient(
            TorqueCommands(self._limits.names, source, self._axes.clock), open_stream
        )

    def _torque_limits(self, chosen: IntArray) -> FloatArray:
        limits = []
        for column in chosen:
            joint = self._descriptor.joints[column]
            if joint.effort_limit is None:
                key = joint.key("torque_limit_nm")
                raise InvalidArgument(
                    f"{joint.name}: no torque limit; a torque stream needs"
                    f" joints.{column}.{key} in the robot's file"
                )
            limits.append(joint.effort_limit)
        return np.array(limits, np.float64)
