"""The work itself: take a part here, put it there, and never let go of it on the way."""

from __future__ import annotations

from dataclasses import dataclass, replace

from pick_and_place.arm import Arm

TRAVEL_S = 1.5
LIFT_S = 0.8


@dataclass(frozen=True)
class Place:
    """Position of a part, 0.12 m high: joint angles with the fingers beside it, in rad."""

    base: float
    shoulder: float = -0.11370677
    elbow: float = -1.8616441
    wrist: float = 0.40456556

    @property
    def joints(self) -> list[float]:
        return [self.base, self.shoulder, self.elbow, self.wrist, 1.57079633, 2.17079633]

    @property
    def above(self) -> Place:
        """The same place from 0.1 m above."""
        return replace(self, shoulder=-0.04622459, elbow=-1.48981195, wrist=-0.03474877)


LEFT, RIGHT = Place(0.6), Place(-0.6)


def carry(arm: Arm, source: Place, target: Place) -> None:
    """Carry one part. Raises ArmFailed and leaves the gripper as it is."""
    arm.grip(closed=False)
    arm.move(source.above.joints, TRAVEL_S)
    arm.move(source.joints, LIFT_S)
    arm.grip(closed=True)
    arm.move(source.above.joints, LIFT_S)
    arm.move(target.above.joints, TRAVEL_S)
    arm.move(target.joints, LIFT_S)
    arm.grip(closed=False)
    arm.move(target.above.joints, LIFT_S)
