"""A leader that is read, and a robot whose joints follow it by streams."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Self

import numpy as np

from robotd.api import NANOSECONDS, FloatArray
from robotd.api.robots import JointStream, Robot
from robotd_teleop.alignment import Alignment
from robotd_teleop.joint_map import JointMapping

OWNER = "teleop"
STALE_S = 0.2  # age of the leader's values at which nothing is sent
TIMEOUT_S = 0.2  # without a target after which the robot slows to rest
EDGE = 0.001  # inside of a limit, which the stream clips at


class LeaderFollower:
    """Streams the pose of ``leader`` to ``robot``; a context that ends the streams. One thread.

    Opening it moves nothing; the robot then approaches the leader at ``speed``.

    Attributes:
        alignment: whether the robot follows directly.

    Raises NotReady: joints cannot be commanded, or have another owner.
    """

    def __init__(
        self, leader: Robot, robot: Robot, mappings: Sequence[JointMapping], speed: float
    ) -> None:
        self.alignment = Alignment(speed)
        self._leader, self._robot = leader, robot
        self._streams: list[tuple[JointStream, list[int]]] = []
        leaders = {joint.name: joint for joint in leader.descriptor.joints}
        joints = {joint.name: joint for joint in robot.descriptor.joints}
        self._leader_axes = [leaders[mapping.leader].axis for mapping in mappings]
        moved = [joints[mapping.joint] for mapping in mappings]
        self._axes = [joint.axis for joint in moved]
        self._scale = np.array([mapping.scale for mapping in mappings])
        self._offset = np.array([mapping.offset for mapping in mappings])
        self._lower = np.array([joint.lower + EDGE for joint in moved])
        self._upper = np.array([joint.upper - EDGE for joint in moved])
        self._open = ExitStack()
        with ExitStack() as opened:
            for group in robot.groups.values():
                places = [
                    place
                    for place, mapping in enumerate(mappings)
                    if mapping.joint in group.joint_names
                ]
                if places:
                    names = [mappings[place].joint for place in places]
                    stream = group.stream(names, mode="smooth", timeout_s=TIMEOUT_S, owner=OWNER)
                    self._streams.append((opened.enter_context(stream), places))
            self._open = opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    @property
    def end(self) -> str:
        """Reason of the end; "" while the robot follows."""
        ended = [stream.message for stream, _ in self._streams if not stream.open]
        return ended[0] if ended else ""

    def wanted(self) -> FloatArray | None:
        """Return the pose that the leader asks for, (n,) within the limits; None: not known."""
        image = self._leader.image.copy()
        age_s = (self._leader.clock.now_ns() - image.fresh_ns) / NANOSECONDS
        positions = image.position[self._leader_axes]
        faulty = image.offline[self._leader_axes].any() or not np.isfinite(positions).all()
        if not image.fresh_ns or age_s > STALE_S or faulty:
            return None
        wanted: FloatArray = np.clip(
            self._scale * positions + self._offset, self._lower, self._upper
        )
        return wanted

    def step(self, elapsed_s: float) -> bool:
        """Send the next targets; False: the leader is not known, and the robot slows to rest.

        Raises NotReady: a stream has ended, with the reason.
        """
        wanted = self.wanted()
        if wanted is None:
            self.alignment.restart()
            return False
        present = self._robot.image.copy().position_command[self._axes]
        targets = self.alignment.step(wanted, present, elapsed_s)
        for stream, places in self._streams:
            stream.send(targets[places].tolist())
        return True
