"""Frames of a tool: the chosen tool in its link, and the chosen work frame in the base."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property

import numpy as np

from robotd.api import (
    FloatArray,
    InvalidArgument,
    NotReady,
    did_you_mean,
    get_logger,
    read_urdf,
)
from robotd.api.features import EventKind, Level
from robotd.api.robots import JointGroup, Robot
from robotd_tool_space.collision.scene import Scene
from robotd_tool_space.frames.followed_frame import FOLLOWED, FROZEN, FollowedFrame, FrameSource
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import checked_pose, inverse_pose
from robotd_tool_space.settings import ToolSpaceKeys

log = get_logger("tool")

CUSTOM_TOOL = "custom_tool"  # name of a tool that is not of the robot's file
CUSTOM_FRAME = "custom_frame"  # name of such a work frame


class ToolFrames:
    """Tool and work frame of one joint group, chosen while it is at rest. Any worker thread.

    Args:
        robot: of the tool.
        group: joint group that moves it.

    Attributes:
        group: joint group that moves the tool.
        at_link: kinematics of the link that the tools are fixed to.
        on_tool: called with the name of a tool that is being chosen, while nothing can move.
        on_change: called when a tool or a work frame was chosen.
        choices: number of tools and work frames that were chosen.
        scene: what the arm keeps away from; None where collisions are not checked.
        frame_source: of the work frames ``tf:NAME`` and ``follow:NAME``; None: there are none.
        followed: work frame that moves; None: the chosen one does not.

    Raises Unsupported, DescriptorError: as ``Kinematics.of_descriptor``.
    """

    def __init__(self, robot: Robot, group: JointGroup) -> None:
        self.group = group
        self.on_change: Callable[[], None] = lambda: None
        self.on_tool: Callable[[str], None] = lambda name: None
        self._robot = robot
        self._settings = robot.descriptor.settings(ToolSpaceKeys).tool_space
        self.at_link = Kinematics.of_descriptor(robot.descriptor, group.name, group.follower.limits)
        self._lock = threading.Lock()
        self._tool = self._settings.tool or ""
        self._work_frame = self._settings.work_frame or ""
        self._custom_frame: FloatArray = np.eye(4)
        self._kinematics = self._with_tool(self._tool)
        self.choices = 0
        self.scene: Scene | None = None
        self.frame_source: FrameSource | None = None
        self.followed: FollowedFrame | None = None

    @property
    def base(self) -> str:
        """Link that the poses are in without a work frame."""
        return self.at_link.chain.base

    @property
    def link(self) -> str:
        """Link that the tools are fixed to."""
        return self.at_link.chain.link

    @property
    def tool_name(self) -> str:
        """Name of the chosen tool; "" for the link itself, ``CUSTOM_TOOL`` after ``set_tool``."""
        return self._tool

    @property
    def work_frame_name(self) -> str:
        """Name of the chosen work frame; "" for the base, ``CUSTOM_FRAME`` of one that was set."""
        return self._work_frame

    @property
    def are_of_file(self) -> bool:
        """The chosen tool and work frame are in the robot's file, or none."""
        of_file = self._work_frame in ("", *self.work_frame_names)
        return of_file and self._tool != CUSTOM_TOOL

    @property
    def tool_names(self) -> tuple[str, ...]:
        """Names of the tools in the robot's file."""
        return tuple(self._settings.tools)

    @property
    def work_frame_names(self) -> tuple[str, ...]:
        """Names of the work frames in the robot's file."""
        return tuple(self._settings.work_frames)

    def named_frames(self) -> list[tuple[str, str, FloatArray]]:
        """Return parent, name and pose (4, 4) of each tool and work frame."""
        tools = [(self.link, *tool) for tool in self._settings.tools.items()]
        frames = [(self.base, *frame) for frame in self._settings.work_frames.items()]
        return [(parent, name, frame.pose) for parent, name, frame in (*tools, *frames)]

    def chosen_frames(self) -> list[tuple[str, str, FloatArray]]:
        """Return parent, name and pose (4, 4) of the chosen tool and the chosen work frame."""
        tool = (self.link, self._tool, self.tool_frame)
        work_frame = (self.base, self._work_frame, self.work_frame)
        return [named for named in (tool, work_frame) if named[1]]

    @property
    def tool_frame(self) -> FloatArray:
        """The chosen tool in its link, (4, 4)."""
        return inverse_pose(self.at_link.chain.end) @ self._kinematics.chain.end

    @property
    def kinematics(self) -> Kinematics:
        """Kinematics of the chosen tool, in the base of the arm."""
        return self._kinematics

    @property
    def work_frame(self) -> FloatArray:
        """The chosen work frame in the base, (4, 4); of a followed one where it is now."""
        if self.followed is not None:
            return self.followed.pose
        return self.work_frame_of(self._work_frame)

    @property
    def fixed_work_frame(self) -> FloatArray:
        """The chosen work frame for plans. Raises NotReady: it is followed."""
        return self.work_frame_of(self._work_frame)

    def kinematics_of(self, tool: str) -> Kinematics:
        """Return the kinematics of a tool by its name, "" for the link itself.

        ``CUSTOM_TOOL`` is the tool of ``set_tool``. Raises InvalidArgument: unknown name.
        """
        if tool == self._tool:
            return self._kinematics
        self._require_known("tool", tool, self.tool_names)
        return self._with_tool(tool)

    def work_frame_of(self, name: str) -> FloatArray:
        """Return a work frame in the base, (4, 4), by its name; "" for the base.

        ``CUSTOM_FRAME`` and frames of the world are known while they are chosen. Raises
        InvalidArgument: unknown name; NotReady: it is followed.
        """
        if name == self._work_frame and self.followed is not None:
            frozen = name.replace(FOLLOWED, FROZEN)
            text = f"work frame {name!r} moves, and only streams of the tool follow it"
            raise NotReady(f"{text}; {frozen!r} is where it is at the choice")
        if name == self._work_frame and name not in ("", *self.work_frame_names):
            return self._custom_frame
        if name.startswith((FROZEN, FOLLOWED)):
            raise InvalidArgument(f"work frame {name!r}: its pose is known once it is chosen")
        self._require_known("work frame", name, self.work_frame_names)
        return self._settings.work_frames[name].pose if name else np.eye(4)

    def select_tool(self, name: str) -> None:
        """Choose a tool by its name in the robot's file; "" for the link itself.

        Raises InvalidArgument: unknown name; NotReady: the joints move.
        """
        self._require_known("tool", name, self.tool_names)
        self._use_tool(name, self._with_tool(name))

    def set_tool(self, frame: FloatArray) -> None:
        """Use a tool at ``frame`` (4, 4) in the link until another is chosen.

        Raises NotReady: the joints move.
        """
        self._use_tool(CUSTOM_TOOL, self.at_link.with_tool(frame))

    def _use_tool(self, name: str, kinematics: Kinematics) -> None:
        _ = kinematics.task  # takes a while: not in the control loop, which begins streams
        with self._choosing(f"tool {name!r}"):
            self._kinematics, self._tool = kinematics, name
            self.on_tool(name)
        log.info("tool chosen", group=self.group.name, tool=name or self.link)

    def select_work_frame(self, name: str) -> None:
        """Choose a work frame by its name; "" for the base.

        ``tf:NAME`` is where a frame of ``/tf`` is now, and stays there. ``follow:NAME`` moves with
        that frame, for streams. Both wait for its transforms, and need the nodes of the robot.

        Raises InvalidArgument: unknown name; NotReady: the joints move, or it cannot be followed.
        """
        if name.startswith((FROZEN, FOLLOWED)):
            self._select_world_frame(name)
            return
        self._require_known("work frame", name, self.work_frame_names)
        self._use_work_frame(name)

    def set_work_frame(self, frame: FloatArray) -> None:
        """Use a work frame at ``frame`` (4, 4) in the base until another is chosen.

        It stays where it is, whatever it was measured from. Raises NotReady: the joints move.
        """
        self._use_work_frame(CUSTOM_FRAME, checked_pose(frame, "work frame").copy())

    def _select_world_frame(self, name: str) -> None:
        what = f"work frame {name!r}"
        if self.frame_source is None:
            raise NotReady(f"{what}: transforms are received by the nodes of the robot only")
        self._require_rest(what)  # of the transforms of the arm itself
        if name.startswith(FROZEN):
            frame = name.removeprefix(FROZEN)
            self._use_work_frame(name, self.frame_source.find(self.base, frame))
            return
        frame = name.removeprefix(FOLLOWED)
        links, on_failure = self._carried_links, self._note_lost
        followed = self.frame_source.follow(self.base, frame, links, on_failure)
        try:
            self._use_work_frame(name, followed=followed)
        except NotReady:
            followed.end()
            raise

    def _note_lost(self, reason: str) -> None:
        self._robot.events.add(EventKind.STATE, "tool", reason, level=Level.WARNING)

    @cached_property
    def _carried_links(self) -> tuple[str, ...]:
        """Links that the joints of the tool move."""
        if (path := self._robot.descriptor.urdf) is None:
            return ()  # never: a chain has one
        urdf = read_urdf(path)
        moved = [urdf.joint[name].child for name in self.at_link.chain.moving]
        return (*dict.fromkeys([*moved, self.link]),)

    def _use_work_frame(
        self,
        name: str,
        frame: FloatArray | None = None,
        followed: FollowedFrame | None = None,
    ) -> None:
        """Choose a work frame; ``frame`` (4, 4) in the base where it is not in the file."""
        what = f"work frame {name!r}"
        with self._choosing(what):
            if followed is not None:  # which starts no client that commands in it already
                interruptions = self._robot.rearming.interruptions
                interruptions.add(self.group.joint_axes, f"{what} was chosen")
            before, self.followed = self.followed, followed
            self._custom_frame = np.eye(4) if frame is None else frame
            self._work_frame = name
        if before is not None:
            before.end()
        log.info("work frame chosen", group=self.group.name, work_frame=name or self.base)

    @contextmanager
    def _choosing(self, what: str) -> Iterator[None]:
        with self._lock:  # until it is published: the newest is the last one
            with self.group.motion.lock:
                self._require_rest(what)
                yield
                self.choices += 1
            self.on_change()

    def _with_tool(self, name: str) -> Kinematics:
        chosen = self._settings.tools.get(name)
        return self.at_link if chosen is None else self.at_link.with_tool(chosen.pose)

    def _require_rest(self, what: str) -> None:
        if self.group.motion.moving or self.group.moved_by_device(self._robot.image):
            raise NotReady(f"{what}: the joints move")

    @staticmethod
    def _require_known(kind: str, name: str, known: Sequence[str]) -> None:
        if name and name not in known:
            available = ", ".join(known) or "none"
            hint = did_you_mean(name, known)
            raise InvalidArgument(f"unknown {kind} {name!r} (available: {available}){hint}")
