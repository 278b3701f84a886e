"""Tree of transforms between frames: the newest one of each, without a history."""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from robotd.api import FloatArray, InvalidArgument, did_you_mean
from robotd_tool_space.geometry.rotations import inverse_pose

MAX_NAMES = 20  # of the frames that an error lists


class Placed(NamedTuple):
    """Pose of a frame in another one.

    Attributes:
        pose: (4, 4).
        oldest_ns, newest_ns: times of the moving transforms between both; None: all are static.
        passed: names of the frames between both, with the ends.
    """

    pose: FloatArray
    oldest_ns: int | None
    newest_ns: int | None
    passed: frozenset[str]


class _Link(NamedTuple):
    parent: str
    pose: FloatArray
    time_ns: int | None


class TransformTree:
    """Newest transform of each frame in its parent. Any thread."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}
        self._lock = threading.Lock()

    def put(self, parent: str, child: str, pose: FloatArray, time_ns: int | None) -> None:
        """Replace the transform of ``child``; ``time_ns`` None: it is static."""
        with self._lock:
            self._links[child] = _Link(parent, pose, time_ns)

    def find(self, base: str, name: str) -> Placed:
        """Return the pose of frame ``name`` in frame ``base``, by their nearest common frame.

        Raises InvalidArgument: there is none; names the frames that were received.
        """
        with self._lock:
            ups, downs = self._way_up(base), self._way_up(name)
            meeting = next((frame for frame in downs if frame in ups), None)
            if meeting is None:
                raise InvalidArgument(self._missing(base, name))
            up, down = _before(ups, meeting), _before(downs, meeting)
            pose = inverse_pose(self._pose(up)) @ self._pose(down)
            links = (self._links[frame] for frame in (*up, *down))
            times = [link.time_ns for link in links if link.time_ns is not None]
            oldest, newest = (min(times), max(times)) if times else (None, None)
            return Placed(pose, oldest, newest, frozenset((*up, *down, meeting)))

    def _way_up(self, frame: str) -> list[str]:
        """Return the frames from one to the root of its tree; a loop ends where it closes."""
        chain = [frame]
        while (link := self._links.get(chain[-1])) is not None and link.parent not in chain:
            chain.append(link.parent)
        return chain

    def _pose(self, frames: list[str]) -> FloatArray:
        """Return the pose of the first frame in the parent of the last one."""
        pose = np.eye(4)
        for frame in frames:
            pose = self._links[frame].pose @ pose
        return pose

    def _missing(self, base: str, name: str) -> str:
        known = sorted({*self._links, *(link.parent for link in self._links.values())})
        for frame in (base, name):
            if frame not in known:
                listed = ", ".join(known[:MAX_NAMES]) or "none"
                more = ", ..." if len(known) > MAX_NAMES else ""
                hint = did_you_mean(frame, known)
                return f"no transform of frame {frame!r}{hint} (received: {listed}{more})"
        roots = self._way_up(base)[-1], self._way_up(name)[-1]
        below = f"{name!r} is below {roots[1]!r}, {base!r} below {roots[0]!r}"
        return f"no transform between both frames: {below}"


def _before(chain: list[str], frame: str) -> list[str]:
    return chain[: chain.index(frame)]
