"""Parts of a sequence: motions between two rests, and waits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import NamedTuple

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.paths.segments import MotionSegment, SequenceStep, Wait
from robotd_tool_space.paths.tool_motion import ToolMotion


class SequenceMotion(NamedTuple):
    """Motion between two rests of a sequence.

    Attributes:
        first: number of steps of the sequence before it.
        segments: with poses in the base.
    """

    first: int
    segments: Sequence[MotionSegment]
    motion: ToolMotion

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
    def name(self) -> str:
        """Name in messages."""
        return f"segment {self.first + 1}, {self.wait.kind}"


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
    is_whole = not first and all(isinstance(step, MotionSegment) for step in steps)
    for is_motion, group in groupby(steps, lambda step: isinstance(step, MotionSegment)):
        members = list(group)
        if is_motion:
            segments = [step for step in members if isinstance(step, MotionSegment)]
            motion = plan(start, segments, None if is_whole else first)
            parts.append(SequenceMotion(first, segments, motion))
            start = motion.positions[-1]
        else:
            waits = enumerate((step for step in members if isinstance(step, Wait)), first)
            parts += [_checked(SequenceWait(number, wait)) for number, wait in waits]
        first += len(members)
    return parts


def _checked(planned: SequenceWait) -> SequenceWait:
    try:
        planned.wait.check()
    except InvalidArgument as error:
        raise InvalidArgument(f"{planned.name}: {error}") from None
    return planned
