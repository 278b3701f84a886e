"""Frame of the world that moves, as streams of the tool follow it.

Its transforms arrive unevenly and with noise. A critically damped filter, with the poles at
``-FILTER_RATE``, estimates pose and velocity, without a lag while the velocity is constant. Between
two transforms, and while they are under way, the pose is extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import NamedTuple, Protocol

import numpy as np

from robotd.api import FloatArray, NotReady
from robotd_tool_space.geometry.rotations import moved_pose, pose_differences
from robotd_tool_space.geometry.transform_tree import Placed

FROZEN, FOLLOWED = "tf:", "follow:"  # before the name of a frame of the world
FILTER_RATE = 10.0  # 1/s
MAX_AGE_S = 0.5  # of the transforms of a frame that is followed
MAX_JUMP_M, MAX_JUMP_RAD = 0.05, 0.1  # of a transform from where the frame was expected
NANOSECONDS = 1e9


class FrameMotion(NamedTuple):
    """Motion of a frame in the base of an arm.

    Attributes:
        pose: (4, 4).
        twist: (6,) velocity of its origin, m/s, and its angular velocity, rad/s.
    """

    pose: FloatArray
    twist: FloatArray

    def twist_at(self, place: FloatArray) -> FloatArray:
        """Return the velocity (6,) of what the frame carries at ``place`` (3,) in the base."""
        linear, angular = self.twist[:3], self.twist[3:]
        return np.concatenate([linear + np.cross(angular, place - self.pose[:3, 3]), angular])


class _State(NamedTuple):
    """Estimate at a time. Replaced as a whole: the control loop reads it."""

    time_ns: int | None  # None: it does not move
    oldest_ns: int | None
    pose: FloatArray
    twist: FloatArray


class FollowedFrame:
    """Motion of a frame that is followed, until that fails or ends; then it is chosen anew.

    Args:
        name: of the work frame, for errors.
        placed: its present pose in the base of the arm.
        now_ns: clock of the robot, on which the times of the transforms are.
        carried: frames that the arm moves: what they carry is not followed.
        on_failure: called once with the reason of a failure, in any thread; returns at once.

    Raises NotReady: it cannot be followed.

    Attributes:
        failure: reason why the frame is not followed any more; "": it is.
    """

    def __init__(
        self,
        name: str,
        placed: Placed,
        now_ns: Callable[[], int],
        carried: Collection[str],
        on_failure: Callable[[str], None],
    ) -> None:
        self.failure = ""
        self.on_end: Callable[[], None] = lambda: None
        self._name, self._now_ns, self._on_failure = name, now_ns, on_failure
        self._carried = frozenset(carried)
        self._state = _State(placed.newest_ns, placed.oldest_ns, placed.pose, np.zeros(6))
        self._require_not_carried(placed)
        self.require()

    @property
    def pose(self) -> FloatArray:
        """Pose (4, 4) at this time, or the last one that was known."""
        motion = self.motion()
        return self._state.pose if motion is None else motion.pose

    def take(self, placed: Placed) -> None:
        """Correct the estimate by a pose of the frame. One thread."""
        if self.failure:
            return
        try:
            self._require_not_carried(placed)
        except NotReady as reason:
            self._fail(str(reason))
            return
        before, passed_s = self._state, 0.0
        if placed.newest_ns is not None and before.time_ns is not None:
            passed_s = (placed.newest_ns - before.time_ns) / NANOSECONDS
            if passed_s <= 0.0:
                return
        expected = moved_pose(before.pose, passed_s * before.twist)
        error = pose_differences(expected, placed.pose)
        shift, turn = (float(np.linalg.norm(part)) for part in (error[:3], error[3:]))
        if shift > MAX_JUMP_M or turn > MAX_JUMP_RAD:
            limits = f"at most {1e3 * MAX_JUMP_M:g} mm and {MAX_JUMP_RAD:g} rad"
            self._fail(f"{self._name} jumped by {1e3 * shift:.0f} mm and {turn:.2f} rad, {limits}")
            return
        pose, twist = placed.pose, np.zeros(6)
        if passed_s > 0.0:
            fades = math.exp(-FILTER_RATE * passed_s)
            pose = moved_pose(expected, (1.0 - fades**2) * error)
            twist = before.twist + (1.0 - fades) ** 2 / passed_s * error
        self._state = _State(placed.newest_ns, placed.oldest_ns, pose, twist)

    def motion(self) -> FrameMotion | None:
        """Return pose and velocity at this time; None: it is not followed any more. Any thread."""
        state, now_ns = self._state, self._now_ns()
        if state.oldest_ns is not None:
            age_s = (now_ns - state.oldest_ns) / NANOSECONDS
            if age_s > MAX_AGE_S and not self.failure:
                limit = f"at most {MAX_AGE_S:g} s"
                self._fail(f"{self._name}: its transforms are {age_s:.2f} s old, {limit}")
        if self.failure:
            return None
        ahead_s = 0.0 if state.time_ns is None else (now_ns - state.time_ns) / NANOSECONDS
        return FrameMotion(moved_pose(state.pose, ahead_s * state.twist), state.twist)

    def require(self) -> None:
        """Raise NotReady where it is not followed any more."""
        if self.motion() is None:
            raise NotReady(f"{self.failure}: choose the work frame again")

    def end(self) -> None:
        """End following, as another work frame is chosen. Any worker thread."""
        self.failure = self.failure or f"{self._name} is not the work frame any more"
        self.on_end()

    def _require_not_carried(self, placed: Placed) -> None:
        if carried := self._carried & placed.passed:
            frozen = self._name.replace(FOLLOWED, FROZEN)
            text = f"{self._name}: the arm itself moves it, with {min(carried)}"
            raise NotReady(f"{text}; {frozen} is where it is at rest")

    def _fail(self, reason: str) -> None:
        self.failure = reason
        self._on_failure(reason)


class FrameSource(Protocol):
    """Finds frames of the world. Worker threads; both methods wait for their transforms."""

    def find(self, base: str, name: str) -> FloatArray:
        """Return the pose (4, 4) of a frame in the base of an arm. Raises InvalidArgument."""

    def follow(
        self, base: str, name: str, carried: Collection[str], on_failure: Callable[[str], None]
    ) -> FollowedFrame:
        """Return a frame that is followed from now on.

        ``carried`` are the links that the arm moves. Raises InvalidArgument, NotReady.
        """
