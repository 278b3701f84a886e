"""Parts of a sequence: motions between two rests, and waits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import NamedTuple

from robotd.api import FloatArray, InvalidArgument
from robotd.api.robots import ContactLimits, WrenchLimits
from robotd_tool_space.paths.segments import MotionSegment, SequenceStep, Wait
from robotd_tool_space.paths.tool_motion import ToolMotion


class SequenceMotion(NamedTuple):
    """Motion between two rests of a sequence.

    Attributes:
        first: number of steps of the sequence before it.
        segments: with poses in the base; one with ``until`` is alone.
    """

    first: int
    segments: Sequence[MotionSegment]
    motion: ToolMotion

    @property
    def steps(self) -> Sequence[SequenceStep]:
        """Steps that it was planned from."""
        return self.segments

    @property
    def until(self) -> ContactLimits | WrenchLimits | None:
        """Contact at which it ends on its way; None: at its end alone."""
        return self.segments[0].until if self.segments else None

    @property
    def end(self) -> int:
        """Number of steps up to its end."""
        return self.first + len(self.segments)


class SequenceWait(NamedTuple):
    """Wait of a sequence; ``first``: number of steps before it."""

    first: int
    wait: Wait
    motion: None = None

    @property
    def end(self) -> int:
        """Number of steps up to its end."""
        return self.first + 1

    @property
    def steps(self) -> Sequence[SequenceStep]:
        """Steps that it was planned from."""
        return [self.wait]

    @property
    def name(self) -> str:
        """Name in messages."""
        return f"segment {self.first + 1}, {self.wait.kind}"


MOTION, WAIT = -1, -2  # kinds of steps
SequencePart = SequenceMotion | SequenceWait
Planner = Callable[[FloatArray, Sequence[MotionSegment], int | None], ToolMotion]


def plan_parts(
    steps: Sequence[SequenceStep], start: FloatArray, plan: Planner, first: int = 0
) -> list[SequencePart]:
    """Return the motions and waits of a sequence.

    Args:
        steps: with poses in the base.
        start: (n,) positions of the joints.
        plan: returns the motion along segments from a start, with the number of steps before them;
            None: they are all.
        first: number of steps of the sequence that come before.

    Raises Unreachable, InvalidArgument: with the segment.
    """
    parts: list[SequencePart] = []
    kinds = [_kind(step, number) for number, step in enumerate(steps)]
    is_whole = not first and set(kinds) <= {MOTION}
    for kind, group in groupby(zip(kinds, steps, strict=True), lambda pair: pair[0]):
        members = [step for _, step in group]
        if kind != WAIT:
            segments = [step for step in members if isinstance(step, MotionSegment)]
            motion = plan(start, segments, None if is_whole else first)
            parts.append(SequenceMotion(first, segments, motion))
            start = motion.positions[-1]
        else:
            waits = enumerate((step for step in members if isinstance(step, Wait)), first)
            parts += [_checked(SequenceWait(number, wait)) for number, wait in waits]
        first += len(members)
    return parts


def has_contacts(steps: Sequence[SequenceStep]) -> bool:
    """Return True where a segment has ``until``."""
    return any(isinstance(step, MotionSegment) and step.until is not None for step in steps)


def _kind(step: SequenceStep, number: int) -> int:
    """Return what the members of a part have in common; a segment with ``until`` is alone."""
    if isinstance(step, Wait):
        return WAIT
    return MOTION if step.until is None else number


def _checked(planned: SequenceWait) -> SequenceWait:
    try:
        planned.wait.check()
    except InvalidArgument as error:
        raise InvalidArgument(f"{planned.name}: {error}") from None
    return planned
