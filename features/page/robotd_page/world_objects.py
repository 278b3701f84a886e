"""Objects around a simulated robot, as a page draws them."""

from __future__ import annotations

from typing import Any

import numpy as np

from robotd.api import FloatArray
from robotd.api.robots import Robot
from robotd_page.page_message import Message, json_text

DIGITS = 5  # of poses: 0.01 mm


class WorldObjects:
    """Shapes and poses of the objects of a robot's world, which may have none. One thread.

    Args:
        robot: of the world.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._world = robot, robot.world
        self._shown: FloatArray = np.empty(0)

    def describe(self) -> dict[str, Any] | None:
        """Return the frame, and shape and pose of each object; None without objects."""
        world = self._world
        if world is None or not world.objects:
            return None
        shapes = [
            {"name": each.name, "shape": each.shape, "size": each.size_m, "color": each.color}
            for each in world.objects
        ]
        return {"frame": world.frame, "shapes": shapes, "poses": self._poses().tolist()}

    def moved(self) -> Message | None:
        """Return the poses where they differ from those of the call before."""
        if self._world is None or not self._robot.connection.ready:
            return None
        poses = self._poses()
        if np.array_equal(poses, self._shown):
            return None
        self._shown = poses
        return json_text({"type": "objects", "poses": poses.tolist()})

    def _poses(self) -> FloatArray:
        """Return the rounded poses (n, 7), m and quaternions x, y, z, w."""
        return np.empty(0) if self._world is None else self._world.poses().round(DIGITS)
