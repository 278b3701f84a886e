"""Interface of the kinematics of a wheeled base."""

from __future__ import annotations

from typing import Protocol

from robotd.motion.planar import PlanarTwist


class BaseKinematics(Protocol):
    """Wheel speeds from a twist, and back; pure functions, any thread.

    The wheels have a fixed order. No wheel's rim is faster than
    |linear| + |lateral| + ``lever`` · |angular|.
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
