"""Frames of a tool: the chosen tool in its link, and the chosen work frame in the base."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from robotd.api import (
    FloatArray,
    InvalidArgument,
    NotReady,
    did_you_mean,
    get_logger,
)
from robotd.api.robots import JointGroup, Robot
from robotd_tool_space.kinematics import Kinematics
from robotd_tool_space.rotations import checked_pose, inverse_pose
from robotd_tool_space.scene import Scene
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
        """The chosen work frame in the base, (4, 4)."""
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

        ``CUSTOM_FRAME`` is that of ``set_work_frame``, while it is chosen. Raises
        InvalidArgument: unknown name.
        """
        if name == self._work_frame == CUSTOM_FRAME:
            return self._custom_frame
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

        Raises InvalidArgument: unknown name; NotReady: the joints move.
        """
        self._require_known("work frame", name, self.work_frame_names)
        with self._choosing(f"work frame {name!r}"):
            self._work_frame = name
        log.info("work frame chosen", group=self.group.name, work_frame=name or self.base)

    def set_work_frame(self, frame: FloatArray) -> None:
        """Use a work frame at ``frame`` (4, 4) in the base until another is chosen.

        It stays where it is, whatever it was measured from. Raises NotReady: the joints move.
        """
        frame = checked_pose(frame, "work frame").copy()
        with self._choosing("a work frame"):
            self._custom_frame, self._work_frame = frame, CUSTOM_FRAME
        log.info("work frame chosen", group=self.group.name, work_frame=CUSTOM_FRAME)

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
