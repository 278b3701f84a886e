"""Motion to a pose or along a path, shown on the page before it is played."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from robotd.api import FloatArray, NotReady
from robotd.api.robots import Interruption, JointGroup, Robot, TrajectoryRequest
from robotd_page.control_commands import Access, Finite, Message, Question
from robotd_page.held_motion import Heartbeat, HeldMotion, Hold, PlannedMotion
from robotd_teach.joint_groups import commands_at_rest
from robotd_teach.path_recorder import MOVED
from robotd_teach.paths import Paths, Playback
from robotd_teach.poses import Poses
from robotd_tool_space.paths.tool_motion import sampled

MAX_ROWS = 200  # of the motion that a page draws
DECIMALS = 4


class Choice(Message):
    """Motion that the page offers.

    Attributes:
        kind: to a pose, or along a path with the motion to its start.
        name: of the pose or path.
        speed: of a pose, part of the joints' limits; of a path, part of the recorded speed.
        reverse, begin: of a path, see ``Playback``.
    """

    kind: Literal["pose", "path"]
    name: str
    speed: Finite
    reverse: bool = False
    begin: Finite = 0.0


class Planned(NamedTuple):
    """Planned motion of a joint group.

    Attributes:
        start: (n,) where it begins, rad or m.
        rows: (k, n) positions on its way.
        approach: number of the first rows that only lead to the start of a path.
        text: about it.
    """

    group: JointGroup
    request: TrajectoryRequest
    start: FloatArray
    rows: FloatArray
    approach: int
    text: str


def planned(robot: Robot, choice: Choice) -> Planned:
    """Plan from where the joints rest. Nothing moves. Raises what ``Poses`` and ``Paths`` do."""
    if choice.kind == "pose":
        group, request = robot.feature(Poses).plan(choice.name, choice.speed)
        start = commands_at_rest(robot, group)
        part = np.linspace(0.0, 1.0, MAX_ROWS // 4)[:, None]
        rows = start + part * (request.positions[-1] - start)
        text = f"{choice.name}: {request.times_s[-1]:.1f} s, all joints directly"
        return Planned(group, request, start, rows, 0, text)
    playback = Playback(choice.speed, reverse=choice.reverse, begin=choice.begin)
    group, path, text = robot.feature(Paths).plan(choice.name, playback, approach=True)
    motion = path.motion
    times_s = np.linspace(0.0, motion.duration_s, MAX_ROWS)
    approach = int((times_s < path.approach_s).sum())
    request = motion.request(group.joint_names)
    return Planned(group, request, motion.positions[0], sampled(motion, times_s)[0], approach, text)


class Preview(Choice, Question):
    """Question for the rows of a motion; nothing moves."""

    type: Literal["preview"]

    def run(self, access: Access) -> dict[str, Any]:
        plan = planned(access.robot, self)
        return {
            "joints": [*plan.group.joint_names],
            "start": plan.start.round(DECIMALS).tolist(),
            "rows": plan.rows.round(DECIMALS).tolist(),
            "approach": plan.approach,
            "text": plan.text,
        }


class PlayPreview(Choice, Heartbeat):
    """Heartbeat of a motion that the page has shown.

    Attributes:
        start: of the joints as it was shown; elsewhere nothing moves.
    """

    type: Literal["play"]
    start: Annotated[tuple[Finite, ...], Field(max_length=64)]


class HeldPreview(HeldMotion[PlayPreview]):
    """Motion of a preview by one client, which goes on while its heartbeats arrive."""

    what = "Move"

    def open(self, beat: PlayPreview, hold: Hold) -> PlannedMotion:
        groups, began = self._robot.groups.values(), self._interruptions()
        tickets = {group.name: group.motion.ticket() for group in groups}  # before it is planned
        plan = planned(self._robot, beat)
        limits, shown = plan.group.follower.limits, np.array(beat.start)
        far = np.array([MOVED[unit] for unit in limits.units])
        if shown.shape != plan.start.shape or (np.abs(plan.start - shown) > far).any():
            raise NotReady("the arm has moved since this motion was shown: show it again")
        ticket = tickets[plan.group.name]
        motion = plan.group.follower.follow(plan.request, ticket=ticket)
        if self._interruptions() != began:
            raise NotReady("motion was stopped before this one began")
        return PlannedMotion(motion, hold, lambda: self.is_silent(hold))

    def _interruptions(self) -> list[Interruption]:
        axes = [axis for group in self._robot.groups.values() for axis in group.joint_axes]
        newest = self._robot.rearming.interruptions.newest
        return newest(axes, in_mode=True, follows_speed=True)
