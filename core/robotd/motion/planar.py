"""Motion of a base in the plane: twists, poses, and the arc between two poses.

The base's frame has x ahead and y to the left; angles count counter-clockwise, seen from above.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class PlanarTwist(NamedTuple):
    """Velocity of the base: ahead in m/s, turning in rad/s, to the left in m/s."""

    linear: float
    angular: float
    lateral: float = 0.0

    def scaled(self, factor: float) -> PlanarTwist:
        """Return the twist on the same arc, ``factor`` times as fast."""
        return PlanarTwist(self.linear * factor, self.angular * factor, self.lateral * factor)


ZERO_TWIST = PlanarTwist(0.0, 0.0)


class Pose(NamedTuple):
    """Pose of the base in m, heading from -π to π in rad."""

    x: float
    y: float
    heading: float


ORIGIN = Pose(0.0, 0.0, 0.0)


def along_arc(pose: Pose, displacement: PlanarTwist) -> Pose:
    """Return ``pose`` moved along an arc of length √(linear² + lateral²) that turns by ``angular``.

    The chord of an arc of length s and angle a is s · sin(a/2) / (a/2), in the direction of the
    mean heading. In this form nothing cancels where the arc is almost straight.
    """
    half = displacement.angular / 2
    chord = math.sin(half) / half if half else 1.0
    direction = pose.heading + half
    ahead, aside = chord * displacement.linear, chord * displacement.lateral
    cosine, sine = math.cos(direction), math.sin(direction)
    return Pose(
        pose.x + ahead * cosine - aside * sine,
        pose.y + ahead * sine + aside * cosine,
        math.remainder(pose.heading + displacement.angular, 2 * math.pi),
    )
