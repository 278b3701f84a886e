"""Joints of a simulated arm: what a person's hand, gravity and mechanical stops do to servos."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

STEP_RAD = 2 * math.pi / 4096
"""Angle of one encoder step, rad."""


@dataclass(slots=True)
class Joint:
    """One joint. A test may set every field at any time.

    angle: shaft angle, rad, not bounded to one turn.
    load_nm: external torque, N·m; positive turns towards larger angles. Gravity is a load.
    lower, upper: mechanical stops, rad; None: the joint turns without end.
    held: angle at which a hand holds the joint against any torque, rad; None: nobody holds it.
    """

    angle: float = 0.0
    load_nm: float = 0.0
    lower: float | None = None
    upper: float | None = None
    held: float | None = None

    def move(self, angle: float) -> None:
        """Move the joint by hand to ``angle``, rad, and let go. A servo with torque moves back."""
        self.held = None
        self.angle = self.bounded(angle)

    def hold(self, angle: float | None = None) -> None:
        """Hold the joint at ``angle``, rad; None: where it is."""
        self.angle = self.held = self.bounded(self.angle if angle is None else angle)

    def release(self) -> None:
        self.held = None

    def bounded(self, angle: float) -> float:
        if self.held is not None:
            return self.held
        if self.lower is not None:
            angle = max(angle, self.lower)
        if self.upper is not None:
            angle = min(angle, self.upper)
        return angle


class Arm(Mapping[int, Joint]):
    """The joints of all servos on a bus, by the servo's key."""

    def __init__(self, joints: Mapping[int, Joint]) -> None:
        self._joints = dict(joints)

    def __getitem__(self, key: int) -> Joint:
        return self._joints[key]

    def __iter__(self) -> Iterator[int]:
        return iter(self._joints)

    def __len__(self) -> int:
        return len(self._joints)

    @property
    def angles(self) -> dict[int, float]:
        """Shaft angles, rad."""
        return {key: joint.angle for key, joint in self._joints.items()}

    def move(self, angles: Mapping[int, float]) -> None:
        """Move joints by hand to ``angles``, rad, at once."""
        for key, angle in angles.items():
            self._joints[key].move(angle)
