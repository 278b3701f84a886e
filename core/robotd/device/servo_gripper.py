"""A gripper that is a joint: it goes to any position, and presses a part by a bounded error."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, wait_until
from robotd.descriptor import RobotDescriptor
from robotd.descriptor.joint_settings import JointSettings
from robotd.descriptor.servo_gripper_settings import ServoGripperSettings
from robotd.device.axes import Axes, Move
from robotd.device.gripper import REACHED_SHARE, GripperState
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import InvalidArgument, NotReady
from robotd.motion.profile import Profile

SPEED_SHARE = 0.5  # of the joint's limits
STANDSTILL_S = 0.2  # without motion, besides the device's response
STANDSTILL_SHARE = 0.005  # of the stroke, which fingers at rest may move meanwhile
LONGEST_MOVE_S = 600.0  # at any speed scale


class ServoGripper:
    """Gripper on one joint of the robot. Positions are those of the joint, rad or m.

    Fingers that stand still before the commanded position are stalled, by a part as a rule. The
    command is then set to ``squeeze`` beyond their position, so that they press with a part of the
    servo's force for as long as they hold. ``max_effort`` of a goal has no effect.

    Attributes:
        name: in the robot's file.
        joints: name of the joint.
        open_m, closed_m: position at the two ends; rad, in spite of the name, for a revolute joint.
    """

    is_measured = True

    def __init__(
        self, name: str, settings: ServoGripperSettings, joint: JointSettings, axes: Axes
    ) -> None:
        self.name, self.joints = name, (joint.name,)
        self.multipliers: FloatArray = np.ones(1)
        self.open_m, self.closed_m = settings.open_position, settings.closed_position
        self._squeeze, self._joint, self._axes = settings.squeeze, joint, axes
        self._axis = joint.axis
        self._stroke = abs(self.closed_m - self.open_m)
        speed, ramp = SPEED_SHARE * joint.velocity, SPEED_SHARE * joint.acceleration
        self._profile = Profile(speed, ramp, ramp)
        self._moves = 0  # counts them: the newest one replaces the others
        self._lock = threading.Lock()

    @property
    def position_m(self) -> float:
        """Measured position. Any thread."""
        return float(self._axes.image.position[self._axis])

    @property
    def finger_positions(self) -> FloatArray:
        """Measured position of the joint (1,). Any thread."""
        return np.array([self.position_m])

    def checked(self, position_m: float) -> float:
        """Return a commanded position, within the two ends and the limits of the axis in force.

        Raises InvalidArgument: it is beyond an end by more than ``REACHED_SHARE`` of the travel.
        """
        low, high = sorted((self.open_m, self.closed_m))
        margin = REACHED_SHARE * self._stroke
        if not (math.isfinite(position_m) and low - margin <= position_m <= high + margin):
            raise InvalidArgument(f"{self.name}: position {position_m} is outside {low} to {high}")
        return self._within_limits(min(max(position_m, low), high))

    def checked_fingers(self, positions: Mapping[str, float]) -> float:
        """Return the commanded position of the joint, by its name. Raises InvalidArgument."""
        if unknown := [name for name in positions if name not in self.joints]:
            raise InvalidArgument(
                f"joint {unknown[0]} is unknown (available: {', '.join(self.joints)})"
            )
        if not positions:
            raise InvalidArgument("the command has no position")
        return self.checked(positions[self.joints[0]])

    def move(
        self, position_m: float, is_canceled: Callable[[], bool] = lambda: False
    ) -> GripperState:
        """Move to a position, and wait until the fingers are at rest. Any worker.

        A later move replaces it. Canceling stops the fingers. Fingers that are stalled stay where
        they are, pressed by ``squeeze``.

        Args:
            position_m: from ``checked`` or ``checked_fingers``.
            is_canceled: ends the move.

        Raises NotReady: the axis cannot be moved, has another owner, or was stopped meanwhile.
        """
        with self._lock:
            self._moves += 1
            number = self._moves
            self._command(position_m)
        watch = _Standstill(self._axes.clock, self._settle_s, STANDSTILL_SHARE * self._stroke)

        def replaced() -> bool:
            return self._moves != number

        def at_rest() -> bool:
            """The fingers are at rest, and not because they are slow."""
            image = self._axes.image.copy()
            rest = watch.rests(float(image.position[self._axis]))
            self._require_command(position_m, image, replaced)
            lead = abs(float(image.position_command[self._axis] - image.position[self._axis]))
            return rest and (lead >= self._squeeze or not _moves(image, self._axis))

        self._axes.wait_for_motion()
        rested = False

        def ended() -> bool:
            nonlocal rested
            rested = at_rest()
            return rested or is_canceled() or replaced()

        wait_until(ended, LONGEST_MOVE_S, self._axes.clock)
        if replaced():
            return GripperState(self.position_m, False, False, False)
        if not rested:
            self._axes.stop([self._axis])
            return GripperState(self.position_m, False, False, False)
        found = self.position_m
        if abs(found - position_m) <= REACHED_SHARE * self._stroke:
            return GripperState(found, True, False, True)
        self._hold(number, found, position_m)
        return GripperState(found, False, True, True)

    @property
    def _settle_s(self) -> float:
        return STANDSTILL_S + self._axes.response_s + self._axes.feedback_period_s

    def _hold(self, number: int, found: float, wanted: float) -> None:
        """Press what stalls the fingers at ``found``, unless a later move has begun."""
        lead = min(self._squeeze, abs(wanted - found))
        with self._lock:
            if self._moves == number:
                self._command(found + math.copysign(lead, wanted - found))

    def _command(self, position_m: float) -> None:
        target = self._within_limits(position_m)
        self._axes.move([Move(self._axis, target, self._profile)])

    def _within_limits(self, position_m: float) -> float:
        limits = self._axes.limits[self._axis]
        return min(max(position_m, limits.lower), limits.upper)

    def _require_command(
        self, wanted: float, image: ProcessImage, replaced: Callable[[], bool]
    ) -> None:
        """Raise NotReady: a stop, a fault or another command has ended the move."""
        if fault := image.fault(self._axis):
            raise NotReady(f"{self.name}: {fault}")
        if not image.servo_on[self._axis]:
            raise NotReady(f"{self.name}: the servo of {self._joint.name} is off")
        away = abs(float(image.position_command[self._axis]) - wanted)
        if away > REACHED_SHARE * self._stroke and not _moves(image, self._axis) and not replaced():
            raise NotReady(f"{self.name}: stopped before it was at {wanted:g}")


def servo_grippers(descriptor: RobotDescriptor, axes: Axes) -> dict[str, ServoGripper]:
    """Return the grippers of ``servo_grippers``, by name."""
    joints = {joint.name: joint for joint in descriptor.joints}
    return {
        name: ServoGripper(name, settings, joints[settings.joint], axes)
        for name, settings in descriptor.servo_grippers.items()
    }


def _moves(image: ProcessImage, axis: int) -> bool:
    """Return whether the command of ``axis`` is under way."""
    return image.operation[axis] in (Operation.POSITION, Operation.STOPPING)


class _Standstill:
    """Judges from positions whether fingers are at rest. One thread."""

    def __init__(self, clock: Clock, settle_s: float, tolerance: float) -> None:
        self._clock, self._settle_ns = clock, round(settle_s * NANOSECONDS)
        self._tolerance = tolerance
        self._at, self._since_ns = math.nan, clock.now_ns()

    def rests(self, position: float) -> bool:
        """Take a position; return whether it has been this one for the time to settle."""
        now_ns = self._clock.now_ns()
        if not abs(position - self._at) <= self._tolerance:
            self._at, self._since_ns = position, now_ns
        return now_ns - self._since_ns > self._settle_ns
