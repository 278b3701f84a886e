"""Streams: motion of joints that a client decides while it happens."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import NANOSECONDS, Clock
from robotd.control.groups.streams import (
    OpenStream,
    StreamClient,
    StreamCommands,
    StreamOpener,
    chosen_columns,
    chosen_timeout,
)
from robotd.control.loop.rearming import CommandSource
from robotd.control.sources.stream_source import (
    MovingReference,
    PointWindow,
    StreamCommand,
    StreamMode,
    StreamMotion,
)
from robotd.device.state import CommandMode
from robotd.errors import InvalidArgument, Unsupported
from robotd.motion import JointLimits, MotionState
from robotd.motion.sliding_window import WIDTH_S

OWNER = "stream"
NEUTRAL = "the present position or a velocity of 0"


@dataclass(frozen=True)
class StreamStatistics:
    """Counts of one stream.

    Attributes:
        commands: received.
        clipped: commands with a position or a velocity beyond a limit, which was used instead.
        timeouts: times that the joints slowed to rest because no command came.
    """

    commands: int
    clipped: int
    timeouts: int


class JointCommands(StreamCommands):
    """Commands of positions and velocities to some joints. Any thread; nothing blocks.

    ``sent_ns`` is the time of a command on the robot's clock, from which its age counts; None, or a
    time to come: now.

    Args:
        joints, source, clock: see ``StreamCommands``.
        present: returns (k,) present positions, as commanded.
        tolerance: (k,) distance from them at which a position asks for no motion.

    Every method raises:
        InvalidArgument: a wrong number of values, or one that is not finite.
        NotReady: a state rejects motion, or its client went on commanding while one did and has to
            begin anew; with the reason.
    """

    def __init__(
        self,
        joints: Sequence[str],
        source: CommandSource,
        clock: Clock,
        present: Callable[[], FloatArray],
        tolerance: FloatArray,
    ) -> None:
        super().__init__(joints, source, clock)
        self._present, self._tolerance = present, tolerance

    def position(
        self,
        position: Sequence[float],
        velocity: Sequence[float] | None = None,
        *,
        sent_ns: int | None = None,
    ) -> StreamCommand:
        """Return the command of ``JointStream.send``."""
        target = self._values("position", position)
        speed = None if velocity is None else self._values("velocity", velocity)
        self._admit(target, speed)
        return StreamCommand(target, speed, self._time_ns(sent_ns))

    def velocity(self, velocity: Sequence[float], sent_ns: int | None = None) -> StreamCommand:
        """Return the command of ``JointStream.send_velocity``."""
        speed = self._values("velocity", velocity)
        self.source.admit(moves=bool(speed.any()))
        return StreamCommand(None, speed, self._time_ns(sent_ns))

    def points(
        self,
        times_ns: Sequence[int],
        position: FloatArray | Sequence[Sequence[float]],
        velocity: FloatArray | Sequence[Sequence[float]] | None = None,
        *,
        sent_ns: int | None = None,
    ) -> StreamCommand:
        """Return the command of ``JointStream.send_points``."""
        if not times_ns or any(later <= time_ns for time_ns, later in pairwise(times_ns)):
            raise InvalidArgument("times of the points must increase, and there must be one")
        positions = self._rows("position", position, len(times_ns))
        if velocity is None:
            speeds = _slopes(times_ns, positions)
        else:
            speeds = self._rows("velocity", velocity, len(times_ns))
        self._admit(positions, speeds)
        window = PointWindow(times_ns, positions, speeds)
        return StreamCommand(positions[-1], speeds[-1], self._time_ns(sent_ns), window)

    def reference(
        self,
        reference: MovingReference,
        value: Any,
        *,
        moves: bool,
        sent_ns: int | None = None,
    ) -> StreamCommand:
        """Return the command of ``JointStream.send_reference``."""
        self.source.admit(moves=moves)
        time_ns = self._time_ns(sent_ns)
        return StreamCommand(None, None, time_ns, reference=reference, value=value)

    def _admit(self, target: FloatArray, speed: FloatArray | None) -> None:
        """Admit targets (..., k) with their velocities; one elsewhere asks for motion."""
        rests = bool((np.abs(target - self._present()) <= self._tolerance).all())
        self.source.admit(moves=not rests or (speed is not None and bool(speed.any())))

    def _rows(
        self, what: str, rows: FloatArray | Sequence[Sequence[float]], count: int
    ) -> FloatArray:
        """Return (n, k) finite values. Raises InvalidArgument."""
        if len(rows) != count:
            raise InvalidArgument(f"{what}: {len(rows)} points for {count} times")
        if {len(row) for row in rows} == {len(self.joints)}:
            values: FloatArray = np.array(rows, np.float64)
            if np.isfinite(values).all():
                return values
        return np.array([self._values(what, row) for row in rows])  # raises, with the reason


class JointStream(OpenStream[StreamMotion]):
    """Open stream of some joints, made by ``Robot.stream``; a context that closes it.

    ``send``, ``send_velocity`` and ``send_points`` may be called by any thread and never block.
    They raise as ``JointCommands``, and NotReady when the stream has ended; in the mode ``smooth``
    InvalidArgument for all but positions.

    Args:
        release: stops ``motion`` and gives the joints back.
        columns: (k,) index of the stream's joints among the m joints of ``limits``.
        limits: of all joints.
    """

    def __init__(
        self,
        commands: JointCommands,
        motion: StreamMotion,
        release: Callable[[StreamMotion], None],
        columns: IntArray,
        limits: JointLimits,
    ) -> None:
        super().__init__(commands, motion, release)
        self._commands, self._columns, self._count = commands, columns, len(limits.names)
        self._units = tuple(limits.units[column] for column in columns)
        self._limits = {
            "position": (limits.lower[columns], limits.upper[columns]),
            "velocity": (-limits.velocity[columns], limits.velocity[columns]),
        }

    @property
    def statistics(self) -> StreamStatistics:
        """Counts so far."""
        return StreamStatistics(self._received, self.clipped, self._motion.timeouts)

    def send(
        self,
        position: Sequence[float],
        velocity: Sequence[float] | None = None,
        *,
        sent_ns: int | None = None,
    ) -> None:
        """Move towards ``position``; positions beyond a limit are clipped and counted.

        Args:
            position: one for each of ``joints``, in rad or m.
            velocity: at ``position``, in rad/s or m/s: the joints go on with it until the next
                command, without a lag. None: the target is at rest.
            sent_ns: see ``JointCommands``.
        """
        self._require_open()
        self.put(self._commands.position(position, velocity, sent_ns=sent_ns))

    def send_velocity(self, velocity: Sequence[float], *, sent_ns: int | None = None) -> None:
        """Move with ``velocity``, one for each of ``joints``, in rad/s or m/s.

        Velocities beyond a limit are clipped and counted. A joint comes to rest at its position
        limit.
        """
        self._require_open()
        self.put(self._commands.velocity(velocity, sent_ns))

    def send_points(
        self,
        times_ns: Sequence[int],
        position: FloatArray | Sequence[Sequence[float]],
        velocity: FloatArray | Sequence[Sequence[float]] | None = None,
        *,
        sent_ns: int | None = None,
    ) -> None:
        """Move along points of the near past and future, as MoveIt Servo sends them.

        They replace those of the call before from the first one on, and the motion goes on from
        one call to the next. After the last one the joints continue with its velocity until the
        next call, or ``timeout_s`` after ``sent_ns``. Points in the past are passed over. What is
        beyond a limit is clipped and counted.

        Args:
            times_ns: (n,) increasing, on the robot's clock.
            position: (n, k) for each of ``joints``, in rad or m.
            velocity: (n, k) in rad/s or m/s; None: those of a curve through the points, 0 at the
                last.
            sent_ns: see ``JointCommands``.
        """
        self._require_open()
        self.put(self._commands.points(times_ns, position, velocity, sent_ns=sent_ns))

    def send_reference(
        self,
        reference: MovingReference,
        value: Any,
        *,
        moves: bool,
        sent_ns: int | None = None,
    ) -> None:
        """Let ``reference`` move the joints, and take ``value`` in the control loop.

        After ``timeout_s`` without a command, and at the end of the stream, it is asked to stop.
        For a stream of all joints of its group, in the mode ``target``.

        Args:
            reference: one object for all commands of the stream.
            value: immutable; for ``reference.take``.
            moves: the command asks for motion; see ``CommandSource``.
            sent_ns: see ``JointCommands``.
        """
        self._require_open()
        self.put(self._commands.reference(reference, value, moves=moves, sent_ns=sent_ns))

    def put(self, command: StreamCommand) -> None:
        """Follow a command for the stream's joints, within their limits."""
        smooth, window = self._motion.mode is StreamMode.SMOOTH, command.window
        if command.reference is not None and (smooth or len(self.joints) < self._count):
            text = "reference: the stream must have all joints, and not be a smooth one"
            raise InvalidArgument(text)
        if smooth and command.velocity is not None and command.position is not None:
            what = "velocity" if window is None else "points"
            raise InvalidArgument(f"{what}: a smooth stream takes positions only")
        self._require_open()
        if window is None:
            position, velocity = command.position, command.velocity
            position = None if position is None else self._fitted("position", position)
            velocity = None if velocity is None else self._fitted("velocity", velocity)
            command = replace(command, position=position, velocity=velocity)
        else:
            command = self._along(window, command.time_ns)
        self._received += 1
        self._motion.put(command)

    def _counts(self) -> dict[str, int]:
        return {**super()._counts(), "timeouts": self._motion.timeouts}

    def _along(self, window: PointWindow, time_ns: int) -> StreamCommand:
        """Return the command of a window whose points are all passed before the time-out."""
        end_ns = window.times_ns[-1]
        if not window.velocity[-1].any():  # the end of the motion is rounded off
            end_ns += round(WIDTH_S * NANOSECONDS)
        time_ns = max(time_ns, end_ns - self._motion.timeout_ns)
        position = self._fitted("position", window.position)
        velocity = self._fitted("velocity", window.velocity)
        fitted = PointWindow(window.times_ns, position, velocity)
        return StreamCommand(position[-1], velocity[-1], time_ns, fitted)

    def _fitted(self, what: str, values: FloatArray) -> FloatArray:
        """Return (..., m) values within the limits, of all joints; NaN for those of others."""
        every: FloatArray = np.full((*values.shape[:-1], self._count), np.nan)
        every[..., self._columns] = self._clip(what, values, *self._limits[what], self._units)
        return every


class JointStreams(StreamOpener):
    """Opens streams of the joints of a group, one at a time."""

    def __call__(
        self,
        joints: Sequence[str] | None = None,
        *,
        timeout_s: float | None = None,
        mode: str = StreamMode.TARGET,
        owner: str = OWNER,
        takeover: bool | None = None,
        ends_when_silent: bool = False,
        max_velocity: Sequence[float] | None = None,
        source: CommandSource | None = None,
    ) -> JointStream:
        """Return an open stream of some joints.

        Args:
            joints: in the order of the values to send; None: all.
            timeout_s: age of the last command at which the joints slow to rest; None: the
                descriptor's.
            mode: ``target`` or ``smooth``.
            owner: name of the client, for those who ask for the same joints.
            takeover: take the joints from another owner in motion; None: as the descriptor says.
            ends_when_silent: the stream ends ``timeout_s`` after the last command.
            max_velocity: one for each of ``joints``, rad/s or m/s; None: their limits. A lower
                one than the limit is used, whatever is commanded.
            source: of the commands; None: that of ``owner``.

        Raises:
            InvalidArgument: unknown joint or mode, or a time-out or velocity that is not positive.
            NotReady: a joint cannot be commanded now, or has another owner, or motion is paused.
            Unsupported: the backend streams no positions.
        """
        limits = self._limits
        columns = chosen_columns(joints, limits.names)
        seconds = chosen_timeout(timeout_s, self._settings.timeout_s)
        if mode not in tuple(StreamMode):
            raise InvalidArgument(f"mode {mode!r} is unknown (available: target, smooth)")
        if self._axes.trajectories_on_device:
            raise Unsupported("streamed positions", self._axes.backend)

        source = source or self._rearming.find(self.source(owner, seconds))
        source.begin()
        scale = self._axes.speed.at_start()
        slowed = replace(limits, velocity=limits.velocity * scale)
        if max_velocity is not None:
            slowed = _limited(slowed, columns, max_velocity)
        allowed = self._settings.takeover if takeover is None else takeover

        def make(state: MotionState, start_ns: int) -> StreamMotion:
            motion = StreamMotion(
                self._axes,
                np.array(self._joint_axes, np.int64),
                state,
                start_ns,
                limits=slowed,
                mode=StreamMode(mode),
                timeout_s=seconds,
                period_s=1.0 / self._descriptor.cycle.rate_hz,
                stopped_velocity=self._rules.stopped_velocity,
                motion_limits=self._motion_limits,
                ends_when_silent=ends_when_silent,
            )
            self._rearming.interruptions.watch(motion.completion, self._joint_axes)
            return motion

        motion = self._motion.start(
            lambda state: partial(make, state), owner=owner, takeover=allowed
        )
        commands = self._commands(columns, source)
        return JointStream(commands, motion, self._motion.release, columns, slowed)

    def source(self, name: str, timeout_s: float) -> CommandSource:
        """Return a new source of commands for the joints; nothing has rejected it yet."""
        modes = [CommandMode.POSITION] * len(self._joint_axes)
        return CommandSource(
            self._rearming, name, self._joint_axes, modes, timeout_s=timeout_s, neutral=NEUTRAL
        )

    def client(self, owner: str, timeout_s: float, name: str = "") -> StreamClient[JointStream]:
        """Return a client for all joints whose streams end ``timeout_s`` after its last command.

        Args:
            timeout_s: silence of the client that ends a stream.
            name: of the client; "": ``owner``.
        """
        source = self.source(name or owner, timeout_s)
        open_stream = partial(
            self, timeout_s=timeout_s, owner=owner, ends_when_silent=True, source=source
        )
        every: IntArray = np.arange(len(self._joint_axes))
        return StreamClient(self._commands(every, source), open_stream)

    def _commands(self, columns: IntArray, source: CommandSource) -> JointCommands:
        names = [self._limits.names[column] for column in columns]
        tolerance = self._rules.start_tolerance[columns]
        return JointCommands(
            names, source, self._axes.clock, lambda: self._motion.command()[columns], tolerance
        )


def _slopes(times_ns: Sequence[int], position: FloatArray) -> FloatArray:
    """Return velocities (n, k) of a curve through the points that ends at rest."""
    velocity: FloatArray = np.zeros_like(position)
    if len(times_ns) > 1:
        seconds = (np.array(times_ns) - times_ns[0]) / NANOSECONDS
        velocity[:-1] = np.gradient(position, seconds, axis=0)[:-1]
    return velocity


def _limited(limits: JointLimits, columns: IntArray, velocity: Sequence[float]) -> JointLimits:
    highest: FloatArray = np.array(velocity, np.float64)
    if highest.shape != columns.shape or not (highest > 0.0).all():
        raise InvalidArgument(
            f"max_velocity is {velocity}, must be a positive number for each of"
            f" {len(columns)} joints"
        )
    lower = limits.velocity.copy()
    lower[columns] = np.minimum(lower[columns], highest)
    return replace(limits, velocity=lower)
