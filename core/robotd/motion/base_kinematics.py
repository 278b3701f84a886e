"""Contracts of the kinematics of bases, which each kind of base fulfils."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Protocol, runtime_checkable

from robotd.motion.planar import ZERO_TWIST, PlanarTwist


@runtime_checkable
class BaseKinematics(Protocol):
    """Wheel speeds from a twist, and back; pure functions, any thread.

    The wheels have a fixed order. No wheel's rim is faster than
    ``|linear| + |lateral| + lever · |angular|``.
    """

    @property
    def moves_sideways(self) -> bool:
        """The base can have a lateral velocity."""

    @property
    def turns_on_the_spot(self) -> bool:
        """The base can turn without a linear velocity."""

    @property
    def steered(self) -> tuple[int, ...]:
        """Places of steering axes, whose part in ``speeds`` and ``twist`` is their angle in rad."""

    @property
    def radius(self) -> float:
        """Radius of the smallest wheel in m."""

    @property
    def lever(self) -> float:
        """Rim speed of the wheels in m/s per rad/s of turning on the spot."""

    def speeds(self, twist: PlanarTwist) -> tuple[float, ...]:
        """Angular velocities of the wheels in rad/s that move the base by ``twist``."""

    def twist(self, *turns: float) -> PlanarTwist:
        """Invert ``speeds``; for wheel angles in rad the result is a displacement.

        Of more wheels than degrees of freedom, the least-squares solution.
        """


class WheelFollower(Protocol):
    """Follows twists with the axes of a base, one step a period. One thread."""

    @property
    def at_rest(self) -> bool:
        """True once the last twist was zero and no axis has yet to move for it."""

    @property
    def twist(self) -> PlanarTwist:
        """Twist of the base after the last step."""

    @property
    def velocities(self) -> Sequence[float]:
        """Angular velocities of all axes in rad/s, those of steering too."""

    @property
    def angles(self) -> Sequence[float]:
        """Angles of the steering axes in rad, in the order of ``BaseKinematics.steered``."""

    def step(self, twist: PlanarTwist) -> None:
        """Move on by one period towards ``twist``, which is within the limits of the base."""


@runtime_checkable
class SteeredKinematics(BaseKinematics, Protocol):
    """Kinematics with steering axes, which cannot follow a twist at once."""

    def follower(
        self, angles: Sequence[float], acceleration: float, period_s: float
    ) -> WheelFollower:
        """Return the follower of one motion, which keeps the limits of the steering axes.

        Args:
            angles: of the steering axes at the start, rad; the driven wheels are at rest.
            acceleration: highest one of a driven wheel, rad/s².
            period_s: of the control loop.
        """


class RollingFollower:
    """Follower of a base without steering: each twist is reached at once."""

    angles: ClassVar[tuple[float, ...]] = ()
    at_rest: ClassVar[bool] = True

    def __init__(self, wheels: BaseKinematics) -> None:
        self.twist = ZERO_TWIST
        self.velocities: tuple[float, ...] = wheels.speeds(ZERO_TWIST)
        self._wheels = wheels

    def step(self, twist: PlanarTwist) -> None:
        """Turn the wheels as ``twist`` needs it."""
        self.twist = twist
        self.velocities = self._wheels.speeds(twist)
