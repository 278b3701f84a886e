"""Recording of the positions of a joint group, whatever moves it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, NotReady, ProcessImage
from robotd.api.robots import JointGroup, Robot

RATE_HZ = 100.0
MAX_S = 180.0
GAP_S = 0.5  # without a position; joints that were moved meanwhile end the recording
MOVED = {"rad": 0.02, "m": 0.005}


class RecordingState(NamedTuple):
    """State of a recording.

    Attributes:
        name: of the path.
        duration_s: recorded so far.
        joints: positions by joint, rad or m; NaN before the first one is recorded.
        reason: why it has ended by itself; "" while it goes on.
    """

    name: str
    duration_s: float
    joints: dict[str, float]
    reason: str


class PathRecording:
    """Measured positions of a joint group. ``look`` in the control loop, the rest any thread.

    Attributes:
        name: of the path.
        replace: another path of this name is replaced.
        reason: why it has ended by itself.
    """

    def __init__(self, name: str, group: JointGroup, *, replace: bool) -> None:
        self.name, self.group, self.replace = name, group, replace
        self.reason = ""
        self._axes = list(group.joint_axes)
        self._moved = np.array([MOVED[unit] for unit in group.follower.limits.units])
        self._stamps_ns: list[int] = []
        self._rows: list[FloatArray] = []

    def look(self, image: ProcessImage) -> None:
        """Add the present positions."""
        stamp_ns, stamps_ns = image.fresh_ns, self._stamps_ns
        if self.reason or (stamps_ns and stamp_ns <= stamps_ns[-1]):
            return
        positions = image.position[self._axes]
        if not np.isfinite(positions).all():
            return
        if stamps_ns:
            gap_s = (stamp_ns - stamps_ns[-1]) / NANOSECONDS
            if gap_s > GAP_S and (np.abs(positions - self._rows[-1]) > self._moved).any():
                self.reason = (
                    f"the joints moved while their positions were not known, {gap_s:.1f} s"
                )
                return
            if stamp_ns - stamps_ns[0] > MAX_S * NANOSECONDS:
                self.reason = f"it has reached its longest time, {MAX_S:g} s"
                return
        self._rows.append(positions)
        stamps_ns.append(stamp_ns)

    @property
    def state(self) -> RecordingState:
        """State of it."""
        count = len(self._stamps_ns)  # written after the row
        if not count:
            unknown = dict.fromkeys(self.group.joint_names, math.nan)
            return RecordingState(self.name, 0.0, unknown, self.reason)
        seconds = (self._stamps_ns[count - 1] - self._stamps_ns[0]) / NANOSECONDS
        positions = self._rows[count - 1].tolist()
        joints = dict(zip(self.group.joint_names, positions, strict=True))
        return RecordingState(self.name, seconds, joints, self.reason)

    def recorded(self) -> tuple[FloatArray, FloatArray]:
        """Return times (k,) from 0 and positions (k, n). Raises NotReady: there are none."""
        count = len(self._stamps_ns)
        if count < 2:
            raise NotReady("nothing was recorded: the positions of the joints are not known")
        stamps_ns = np.array(self._stamps_ns[:count], np.int64)
        return (stamps_ns - stamps_ns[0]) / NANOSECONDS, np.array(self._rows[:count])


class PathRecorder:
    """The recording of a robot that is under way; at most one."""

    def __init__(self, robot: Robot) -> None:
        self.current: PathRecording | None = None
        robot.control_loop.every(RATE_HZ, "path recording", self._look)

    def _look(self, image: ProcessImage) -> None:
        if (recording := self.current) is not None:
            recording.look(image)
