"""Segments of a sequence: moves of the joints, lines, arcs and splines of the tool, and waits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import ContactLimits, WrenchLimits
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import checked_pose, inverse_pose, pose_of
from robotd_tool_space.paths.path_outputs import PathOutput
from robotd_tool_space.paths.tool_curves import (
    ArcCurve,
    LineCurve,
    SplineCurve,
    ToolCurve,
    ToolSpeed,
)
from robotd_tool_space.paths.tool_path import Blend

MIN_SPEED = 0.01
MAX_ANGLE = 4.0 * np.pi  # of an arc, rad
MAX_WAIT_S = 86_400.0


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionSegment:
    """Part of a motion, up to a pose. Poses are matrices (4, 4), m.

    Attributes:
        speed: 0.01 to 1 of the speed of the tool, and of the joints in a ``JointMove``.
        blend_m: distance of the tool from the end of the segment within which the corner to the
            next one is rounded; at most half of either is used. 0: the tool stops there.
        blend_rad: the same of its orientation; None: the angle that the tool turns through at full
            speed in the time of ``blend_m``.
        outputs: that are set near the end of the segment.
        until: contact at which it ends on its way, of a sequence alone; the arm rests before and
            after it, whatever the blends, and what follows begins there. Where it meets nothing the
            sequence ends at its pose. None: it ends at its pose.
    """

    kind: ClassVar[str] = "segment"
    speed: float = 1.0
    blend_m: float = 0.0
    blend_rad: float | None = None
    outputs: tuple[PathOutput, ...] = ()
    until: ContactLimits | WrenchLimits | None = None

    def check(self) -> None:
        """Raise InvalidArgument for a value beyond its bounds."""
        check_speed(self.speed)
        for name, value in (("blend_m", self.blend_m), ("blend_rad", self.blend_rad or 0.0)):
            if not (np.isfinite(value) and value >= 0.0):
                raise InvalidArgument(f"{name} is {value}, must be at least 0 and finite")

    def blend(self, speed: ToolSpeed) -> Blend:
        """Return the bounds of the corner; ``speed``: full speed of the tool."""
        turn = self.blend_m / speed.velocity * speed.angular_velocity
        return Blend(self.blend_m, turn if self.blend_rad is None else self.blend_rad)

    def in_base(self, work_frame: FloatArray) -> Self:
        """Return the segment with its poses in the base instead of ``work_frame`` (4, 4)."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class JointMove(MotionSegment):
    """All joints move directly to their goals together: a curve of the tool.

    Attributes:
        to: (n,) positions, rad or m; or a pose (4, 4), of whose solutions the nearest one counts.
    """

    kind: ClassVar[str] = "joint move"
    to: FloatArray

    def in_base(self, work_frame: FloatArray) -> Self:
        goal = np.asarray(self.to, np.float64)
        if goal.ndim == 2:
            goal = work_frame @ checked_pose(goal)
        return replace(self, to=goal)

    def goal(self, kinematics: Kinematics, here: FloatArray) -> FloatArray:
        """Return the positions (n,) that it leads to from ``here`` (n,).

        Raises Unreachable, InvalidArgument.
        """
        if self.to.ndim == 2:
            return kinematics.inverse(self.to, here)
        if self.to.shape != here.shape or not np.isfinite(self.to).all():
            raise InvalidArgument(f"a joint move needs {len(here)} finite positions")
        excess = np.maximum(kinematics.lower - self.to, self.to - kinematics.upper)
        if (joint := int(excess.argmax())) >= 0 and excess[joint] > 0.0:
            raise InvalidArgument(kinematics.limit_text(joint, float(self.to[joint])))
        return self.to


@dataclass(frozen=True, eq=False)
class ToolSegment(MotionSegment):
    """Curve of the tool."""

    def curve(self, kinematics: Kinematics, start: FloatArray, speed: ToolSpeed) -> ToolCurve:
        """Return the curve from ``start`` (4, 4); ``speed``: of this segment.

        Raises Unreachable, InvalidArgument.
        """
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Line(ToolSegment):
    """Straight line of the tool to a pose; it turns about one axis in step with it."""

    kind: ClassVar[str] = "line"
    to: FloatArray

    def in_base(self, work_frame: FloatArray) -> Self:
        return replace(self, to=work_frame @ checked_pose(self.to))

    def curve(self, kinematics: Kinematics, start: FloatArray, speed: ToolSpeed) -> ToolCurve:
        kinematics.require_possible(start, self.to)
        return LineCurve.to(start, self.to, speed)


@dataclass(frozen=True, eq=False)
class Arc(ToolSegment):
    """Arc of a circle through the position of ``via`` to the pose ``to``.

    The tool turns evenly from its orientation to that of ``to``; that of ``via`` does not count.
    """

    kind: ClassVar[str] = "arc"
    via: FloatArray
    to: FloatArray

    def in_base(self, work_frame: FloatArray) -> Self:
        via, to = checked_pose(self.via, "via"), checked_pose(self.to, "to")
        return replace(self, via=work_frame @ via, to=work_frame @ to)

    def curve(self, kinematics: Kinematics, start: FloatArray, speed: ToolSpeed) -> ToolCurve:
        kinematics.require_possible(start, self.to)
        return ArcCurve.through(start, self.via, self.to, speed)


@dataclass(frozen=True, eq=False)
class ArcAbout(ToolSegment):
    """Arc of a circle about the z axis of the pose ``centre``.

    Attributes:
        angle: rad, of either sign; up to two turns.
        turns: the tool turns with the arc; otherwise it keeps its orientation.
    """

    kind: ClassVar[str] = "arc"
    centre: FloatArray
    angle: float
    turns: bool = field(default=True, kw_only=True)

    def check(self) -> None:
        super().check()
        if not 0.0 < abs(self.angle) <= MAX_ANGLE:
            raise InvalidArgument(
                f"angle is {self.angle:g} rad, must be up to {MAX_ANGLE:.4g} of either sign, not 0"
            )

    def in_base(self, work_frame: FloatArray) -> Self:
        return replace(self, centre=work_frame @ checked_pose(self.centre, "centre"))

    def curve(self, kinematics: Kinematics, start: FloatArray, speed: ToolSpeed) -> ToolCurve:
        return ArcCurve.about(start, self.centre, self.angle, speed, turns=self.turns)

    def end(self, start: FloatArray) -> FloatArray:
        """Return the pose (4, 4) that it leads to from ``start``."""
        turn = self.centre @ pose_of(rpy=[0.0, 0.0, self.angle]) @ inverse_pose(self.centre)
        end = turn @ start
        if not self.turns:
            end[:3, :3] = start[:3, :3]
        return end


@dataclass(frozen=True, eq=False)
class Spline(ToolSegment):
    """Smooth curve of the tool through poses, without a stop: a cubic spline."""

    kind: ClassVar[str] = "spline"
    poses: Sequence[FloatArray]

    def check(self) -> None:
        super().check()
        if not len(self.poses):
            raise InvalidArgument("a spline needs a pose")

    def in_base(self, work_frame: FloatArray) -> Self:
        return replace(self, poses=[work_frame @ checked_pose(pose) for pose in self.poses])

    def curve(self, kinematics: Kinematics, start: FloatArray, speed: ToolSpeed) -> ToolCurve:
        for pose in self.poses:
            kinematics.require_possible(start, pose)
        return SplineCurve.through([start, *self.poses], speed)


@dataclass(frozen=True, kw_only=True)
class Wait:
    """Rest between two segments, for a time or until an input has a level; real time, not scaled.

    The segment before it ends at rest, whatever its blend. Exactly one of ``time_s`` and ``input``.

    Attributes:
        time_s: s.
        input: byte and bit of the image of inputs; ``robot.io.inputs`` has those with names.
        level: of the input.
        timeout_s: after which the sequence ends where the input has another level; None: none.
    """

    kind: ClassVar[str] = "wait"
    time_s: float | None = None
    input: tuple[int, int] | None = None
    level: bool = True
    timeout_s: float | None = None

    def check(self) -> None:
        """Raise InvalidArgument for a value beyond its bounds."""
        if (self.time_s is None) == (self.input is None):
            raise InvalidArgument("a wait needs exactly one of time_s and input")
        for name, value in (("time_s", self.time_s), ("timeout_s", self.timeout_s)):
            if value is not None and not 0.0 < value <= MAX_WAIT_S:
                raise InvalidArgument(f"{name} is {value:g}, must be above 0, to {MAX_WAIT_S:g}")
        if self.timeout_s is not None and self.input is None:
            raise InvalidArgument("timeout_s belongs to an input")

    def in_base(self, work_frame: FloatArray) -> Self:
        """Return itself: it has no poses."""
        return self


SequenceStep = MotionSegment | Wait


def check_speed(speed: float) -> None:
    """Raise InvalidArgument for a part of the speed that is not 0.01 to 1."""
    if not MIN_SPEED <= speed <= 1.0:
        raise InvalidArgument(f"speed is {speed:g}, must be {MIN_SPEED:g} to 1")
