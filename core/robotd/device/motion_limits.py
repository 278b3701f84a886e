"""Limits of a joint group's motion, which features set: its speed, and where it may go."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from robotd.arrays import FloatArray
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import NotReady
from robotd.motion import Trajectory

Factors = Callable[[FloatArray, FloatArray], FloatArray]
"""Returns (k,) by which velocities (k, m) at positions (k, m) may be multiplied; inf at rest."""

# A stream moves all axes of the group, or none.
NOT_MOVING_ALONE = (Operation.IDLE, Operation.STREAM)


PathCheck = Callable[[Trajectory], None]
"""Raises TrajectoryRejected, in a worker, for a path that cannot be executed."""

Obstacle = Callable[[FloatArray, FloatArray], str]
"""Returns what joints would hit between positions (m,) and those where they stop; "": nothing."""


class Solid(NamedTuple):
    """A body that a joint group keeps away from, or carries; for pictures.

    Attributes:
        name: of the body.
        shape: ``box``, ``cylinder``, ``sphere`` or ``plane``.
        size_m: edges; radius and length along z; radius; nothing.
        pose: (4, 4) of its middle in ``link``.
        link: name of the link that the pose is in.
    """

    name: str
    shape: str
    size_m: tuple[float, ...]
    pose: FloatArray
    link: str


class MotionLimits:
    """Limits of the motion of a joint group; none until a feature sets one. Any thread.

    Under a limit of the speed trajectories keep their path, and streams the direction of their
    velocity. A stream that would run into an obstacle is stopped, and its command forgotten.

    ``axes``: of the joints, in their order.

    Attributes:
        factors: of the limit of the speed in force, for the control loop; None: there is none.
        reason, remedy: of that limit, one line each for people; "" without one.
        check_path: called for each trajectory before it begins; None: no check.
        obstacle: called for streams in the control loop; None: no check.
        solids: bodies beside the links for which the feature checks.
    """

    def __init__(self, axes: Sequence[int] = ()) -> None:
        self.axes = tuple(axes)
        self.factors: Factors | None = None
        self.reason = self.remedy = ""
        self.check_path: PathCheck | None = None
        self.obstacle: Obstacle | None = None
        self.solids: tuple[Solid, ...] = ()

    def set_speed(self, factors: Factors, reason: str, remedy: str) -> None:
        """Limit the speed from the next period on."""
        self.reason, self.remedy, self.factors = reason, remedy, factors

    def clear_speed(self) -> None:
        """Remove the limit of the speed, which rises by the ordinary ramps."""
        self.factors, self.reason, self.remedy = None, "", ""

    def scale(self, velocities: Mapping[int, float], image: ProcessImage) -> float:
        """Return the part, up to 1, of the velocity of a single axis that keeps the speed limit.

        While one joint turns alone its distance from the tool stays; so a command keeps its speed.

        ``velocities``: of axes that are about to move by themselves, not in a stream.

        Raises NotReady: more than one joint would move, or a position is unknown.
        """
        factors = self.factors
        chosen = {axis for axis in self.axes if velocities.get(axis)}
        if factors is None or not chosen:
            return 1.0
        operations = image.operation.tolist()
        others = {axis for axis in self.axes if operations[axis] not in NOT_MOVING_ALONE}
        if len(chosen | others - velocities.keys()) > 1:
            raise NotReady(f"{self.reason}; commands of single axes move one joint at a time")
        velocity = np.array([[velocities.get(axis, 0.0) for axis in self.axes]])
        factor = float(factors(image.position[list(self.axes)][None], velocity)[0])
        if not factor > 0.0:  # of a position that is not a number
            raise NotReady(f"{self.reason}; the position of a joint is not known")
        return min(factor, 1.0)
