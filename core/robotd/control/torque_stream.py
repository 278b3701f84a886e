"""Torque streams: torques of joints that a client decides, within limits of the motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS
from robotd.control.completion import Outcome
from robotd.control.joint_source import JointSource, Phase
from robotd.control.open_stream import (
    OpenStream,
    StreamClient,
    StreamCommands,
    StreamOpener,
    chosen_columns,
    chosen_timeout,
)
from robotd.control.rearming import CommandSource
from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.motion_limits import MotionLimits
from robotd.device.process_image import ProcessImage
from robotd.device.soft_limits import REACTION_PERIODS
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, NotReady
from robotd.motion import JointLimits
from robotd.motion.limits import room_to_stop


class TorqueMotion(JointSource):
    """Torques of m joints, ended by a stop of the drives.

    It has no setpoints of position: the device gets torques, and keeps the one that holds the
    joints until the first command. It ends when no command has come for ``timeout_s``, when a
    client requests it, with a fault, and as soon as a joint exceeds its velocity limit or has just
    enough room left to brake before a position limit. The driver then brings the joints to rest in
    position control.

    Args:
        robot: axes of the robot; the stream ends at a speed of 0.
        axes: (m,) index of each joint's axis.
        start_ns: monotonic time of its first period, at the earliest.
        timeout_s: age of the last command at which it ends.
        stopped_velocity: (m,) rad/s or m/s below which a joint is at rest.
        motion_limits: of the group; the stream ends under one, as torques keep none.
    """

    def __init__(
        self,
        driver: AxisDriver,
        robot: Axes,
        axes: IntArray,
        limits: JointLimits,
        start_ns: int,
        timeout_s: float,
        stopped_velocity: FloatArray,
        motion_limits: MotionLimits,
    ) -> None:
        setpoint = np.full((3, len(axes)), np.nan)
        super().__init__(limits, axes, start_ns, setpoint, stopped_velocity)
        self._driver, self._stops, self._speed = driver, robot.stops, robot.speed
        self._limits_of_joints = limits.per_joint()
        self._timeout_s, self._motion_limits = timeout_s, motion_limits
        self._feedback_period_s = robot.feedback_period_s
        self._command: tuple[int, FloatArray | None] = (start_ns, None)  # replaced as a whole
        self._torque: FloatArray = np.zeros(0)  # of all axes of the device; NaN: unchanged

    def put(self, torque: FloatArray, time_ns: int) -> None:
        """Apply ``torque`` (m,), N·m or N, from the next period on; never blocks. Any thread."""
        self._command = time_ns, torque

    def advance(self, time_ns: int, period_ns: int, image: ProcessImage) -> bool:
        """Send the torque for this period, or monitor the stop; return False."""
        if self._phase is Phase.RUNNING and not self.completion.done:
            self._check(time_ns, period_ns, image)
            if self.completion.requested is None:
                self._apply(time_ns + period_ns, image.axes)
            else:
                self._enter(Phase.STOPPING, time_ns)
                self._stops.request(self._axes.tolist())
        elif not self.completion.done:
            self._end_at_rest(time_ns, image)
        return False

    def _apply(self, due_ns: int, axes: int) -> None:
        if not len(self._torque):
            self._torque = np.full(axes, np.nan)
        torque = self._command[1]
        if torque is not None:
            self._torque[self._axes] = torque
        self._driver.stream_torque(self._torque, due_ns)

    def _check(self, time_ns: int, period_ns: int, image: ProcessImage) -> None:
        """Request the end where it has to stop."""
        self._check_drives(image, (time_ns - self.start_ns) / NANOSECONDS, period_ns)
        if not self._speed.scale:
            self.completion.request(Outcome.STOPPED, f"motion is {self._speed.text}")
        elif reason := self._motion_limits.reason or self._excess(period_ns, image):
            self.completion.request(Outcome.STOPPED, reason)
        elif time_ns - self._command[0] > self._timeout_s * NANOSECONDS:
            self.completion.request(Outcome.SUCCEEDED, f"no command for {self._timeout_s:g} s")

    def _excess(self, period_ns: int, image: ProcessImage) -> str:
        """Return the limit that a joint exceeds or is about to; "" without one."""
        reaction_s = REACTION_PERIODS * period_ns / NANOSECONDS + self._feedback_period_s
        rows = zip(
            self._limits.names,
            self._limits_of_joints,
            image.position[self._axes].tolist(),
            image.velocity[self._axes].tolist(),
            strict=True,
        )
        for name, limits, position, velocity in rows:
            unit, fastest = limits.unit, limits.velocity
            if not abs(velocity) <= fastest:  # also of a velocity that is not a number
                return (
                    f"{name}: {velocity:.3g} {unit}/s, its velocity limit is {fastest:g} {unit}/s"
                )
            room = room_to_stop(limits, position, velocity, limits.acceleration)
            inside = limits.lower <= position <= limits.upper
            if not (room >= abs(velocity) * reaction_s and inside):
                limit = limits.upper if velocity > 0.0 else limits.lower
                return f"{name}: at {position:.3g} {unit}, too close to its limit {limit:g} {unit}"
        return ""


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
