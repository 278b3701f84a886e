"""Tools of all joint groups of a robot."""

from __future__ import annotations

from robotd.api import DescriptorError, InvalidArgument, RobotdError, Unsupported, get_logger
from robotd.api.robots import Robot
from robotd_tool_space.robot_tool import RobotTool

log = get_logger("tool")


class ToolGroups(dict[str, RobotTool]):
    """Tools of a robot by the name of their joint group.

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

    def of(self, group: str = "") -> RobotTool:
        """Return the tool of a group, "" for the only one.

        Raises InvalidArgument: no such group; DescriptorError, Unsupported: it has no usable chain.
        """
        if not group and len(self) == 1:
            return next(iter(self.values()))
        if group in self._failed:
            raise self._failed[group]
        if group not in self:
            raise InvalidArgument(f"group {group!r} is none of {', '.join(self)}")
        return self[group]


def tool_groups(robot: Robot) -> ToolGroups | None:
    """Return ``robot.tool_groups``; None, with a line in the log, where there are none."""
    try:
        groups: ToolGroups = robot.attribute("tool_groups")
    except (DescriptorError, Unsupported) as error:
        log.warning("no motion of the tool", reason=str(error))
        return None
    return groups


def only_tool(robot: Robot) -> RobotTool:
    """Return the tool of the only joint group. Raises InvalidArgument with several groups."""
    groups: ToolGroups = robot.attribute("tool_groups")
    return groups.of()
