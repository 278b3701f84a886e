"""Tools of all joint groups of a robot."""

from __future__ import annotations

from robotd.api import DescriptorError, InvalidArgument, RobotdError, Unsupported
from robotd.api.robots import Robot
from robotd_tool_space.robot_tool import RobotTool


class ToolGroups(dict[str, RobotTool]):
    """Tools of a robot by the name of their joint group: ``robot.feature(ToolGroups)``.

    Raises Unsupported, DescriptorError: none of the groups has a usable chain.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__()
        self._failed: dict[str, RobotdError] = {}
        for name, group in robot.groups.items():
            try:
                if group.joint_names:
                    self[name] = RobotTool(robot, group)
            except (DescriptorError, Unsupported) as error:
                self._failed[name] = error
        if not self:
            none = Unsupported(f"the tool of {robot.descriptor.name}, which has no joints")
            raise next(reversed(self._failed.values()), none)

    @property
    def only(self) -> RobotTool:
        """The tool of the only joint group. Raises InvalidArgument with several groups."""
        return self.of()

    def of(self, group: str = "") -> RobotTool:
        """Return the tool of a group, "" for the only one.

        Raises InvalidArgument: no such group, or "" with several; DescriptorError, Unsupported: it
        has no usable chain.
        """
        if not group and len(self) == 1:
            return next(iter(self.values()))
        if group in self._failed:
            raise self._failed[group]
        if not group:
            names = " and ".join([", ".join([*self][:-1]), [*self][-1]])
            raise InvalidArgument(f"the robot has several joint groups, {names}: name one")
        if group not in self:
            raise InvalidArgument(f"group {group!r} is none of {', '.join(self)}")
        return self[group]
