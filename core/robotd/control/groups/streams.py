"""Streams of some joints: commands that are checked, the open stream, and its clients."""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Self, TypeVar

import numpy as np

from robotd.arrays import FloatArray, IntArray
from robotd.clock import Clock
from robotd.control.groups.joint_motion import JointMotion
from robotd.control.loop.rearming import CommandSource, Rearming
from robotd.control.loop.setpoint_source import Outcome, SetpointSource
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Axes
from robotd.device.drivers import AxisDriver
from robotd.device.motion_limits import MotionLimits
from robotd.errors import InvalidArgument, NotReady
from robotd.log import get_logger
from robotd.motion import JointLimits, TrajectoryRules

log = get_logger("stream")

Motion = TypeVar("Motion", bound=SetpointSource)
Stream_co = TypeVar("Stream_co", bound="OpenStream[Any]", covariant=True)


class StreamCommands:
    """Makes the commands of a stream, also before it is opened. Any thread.

    A command is checked and admitted when it is made; a stream takes it by ``put``.

    ``joints``: names, in the order of the values.

    Attributes:
        joints, source: of the commands.
    """

    def __init__(self, joints: Sequence[str], source: CommandSource, clock: Clock) -> None:
        self.joints, self.source, self._clock = tuple(joints), source, clock

    def check_opening(self, command: Any) -> None:
        """Raise NotReady for a command that no stream is opened for."""

    def _time_ns(self, sent_ns: int | None) -> int:
        """Return when a command was sent; a later time would put its time-out off."""
        now_ns = self._clock.now_ns()
        return now_ns if sent_ns is None else min(sent_ns, now_ns)

    def _values(self, what: str, values: Sequence[float]) -> FloatArray:
        """Return one finite value for each joint. Raises InvalidArgument."""
        array = np.array(values, np.float64)
        if array.shape != (len(self.joints),):
            raise InvalidArgument(
                f"{what}: {array.size} values for {len(self.joints)} joints"
                f" ({', '.join(self.joints)})"
            )
        for name, value in zip(self.joints, array.tolist(), strict=True):
            if not math.isfinite(value):
                raise InvalidArgument(f"{name}: {what} is {value}, must be a finite number")
        return array


class OpenStream(ABC, Generic[Motion]):
    """Base of streams; a context that closes it. Any thread, except ``close``: a worker.

    ``release``: stops ``motion`` and gives the joints back.

    Attributes:
        joints: names, in the order of the values that it takes.
        clipped: number of commands with a value beyond a limit, which was used instead.
    """

    def __init__(
        self, commands: StreamCommands, motion: Motion, release: Callable[[Motion], None]
    ) -> None:
        self.joints, self._source = commands.joints, commands.source
        self._motion, self._release = motion, release
        self._received = self.clipped = 0
        self._closing = threading.Lock()  # taken by the first ``close``, for good

    @abstractmethod
    def put(self, command: Any) -> None:
        """Follow ``command`` of the stream's ``StreamCommands``; never blocks. Any thread.

        Raises NotReady, with the reason, after the end.
        """

    @property
    def open(self) -> bool:
        """Commands are accepted."""
        return self._motion.completion.requested is None and not self._motion.completion.done

    @property
    def message(self) -> str:
        """Reason of its end, "" while it is open."""
        completion = self._motion.completion
        return completion.message or (completion.requested[1] if completion.requested else "")

    def end(self, reason: str) -> None:
        """Request the end with a reason; the joints slow to rest. Never blocks."""
        self._motion.completion.request(Outcome.CANCELED, reason)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Block until it has ended, at rest; return False after ``timeout_s`` (None: no limit)."""
        return self._motion.completion.event.wait(timeout_s)

    def close(self) -> None:
        """Slow to rest, wait, and give the joints back; a second call has no effect."""
        if self._closing.acquire(blocking=False):
            self.end("closed by the client")
            self._release(self._motion)
            log.info("stream ended", reason=self.message, **self._counts())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _counts(self) -> dict[str, int]:
        """Counts for the log."""
        return {"commands": self._received, "clipped": self.clipped}

    def _require_open(self) -> None:
        """Raise NotReady, with the reason, after the end."""
        if not self.open:
            self._source.begin()  # it commands on, maybe in another stream next
            raise NotReady(f"the stream has ended: {self.message}")

    def _clip(
        self, what: str, values: FloatArray, low: FloatArray, high: FloatArray, units: Sequence[str]
    ) -> FloatArray:
        """Clip (..., k) values to the limits; count those beyond, log the first."""
        clipped: FloatArray = np.minimum(np.maximum(values, low), high)
        beyond = np.flatnonzero(clipped != values)
        if len(beyond):
            self.clipped += 1
            if self.clipped == 1:
                joint = int(beyond[0]) % len(self.joints)
                log.warning(
                    "a command beyond a limit is clipped",
                    quantity=what,
                    joint=self.joints[joint],
                    value=float(values.flat[beyond[0]]),
                    limit=float(clipped.flat[beyond[0]]),
                    unit=units[joint],
                )
        return clipped


@dataclass(frozen=True)
class StreamClient(Generic[Stream_co]):
    """Client that opens a stream when it has something to command.

    Attributes:
        commands: makes the commands of a stream; raises what rejects them, and nothing moves.
        open: returns an open stream. Worker.
    """

    commands: StreamCommands
    open: Callable[[], Stream_co]


class StreamOpener:
    """Opens streams of the joints of a group, one at a time.

    Called like a function, by worker threads.
    """

    def __init__(
        self,
        motion: JointMotion,
        limits: JointLimits,
        rules: TrajectoryRules,
        motion_limits: MotionLimits,
        axes: Axes,
        rearming: Rearming,
        descriptor: RobotDescriptor,
        driver: AxisDriver,
    ) -> None:
        self._motion, self._limits, self._rules = motion, limits, rules
        self._motion_limits, self._axes, self._rearming = motion_limits, axes, rearming
        self._descriptor, self._settings, self._driver = descriptor, descriptor.stream, driver
        self._joint_axes = tuple(joint.axis for joint in descriptor.joints)


def chosen_columns(joints: Sequence[str] | None, known: Sequence[str]) -> IntArray:
    """Return the index of each of ``joints`` (None: all) among ``known``.

    Raises InvalidArgument for no joint, an unknown one, or one that is given twice.
    """
    chosen = known if joints is None else joints
    if not chosen:
        raise InvalidArgument("no joint given")
    for name in chosen:
        if name not in known:
            raise InvalidArgument(f"joint {name} is unknown (available: {', '.join(known)})")
    if len(set(chosen)) < len(chosen):
        raise InvalidArgument(f"a joint is given twice: {', '.join(chosen)}")
    return np.array([known.index(name) for name in chosen], np.int64)


def chosen_timeout(timeout_s: float | None, default_s: float) -> float:
    """Return ``timeout_s``, or ``default_s`` for None. Raises InvalidArgument."""
    seconds = default_s if timeout_s is None else timeout_s
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise InvalidArgument(f"timeout_s is {seconds}, must be a positive number")
    return seconds
