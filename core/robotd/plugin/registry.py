"""Registries of robots and nodes from plugins; a clash stops the start-up."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from robotd.errors import PluginError


@dataclass
class RobotRegistry:
    """Folders that hold ``<name>/robot.yaml``, in the order in which they are searched."""

    folders: list[Path] = field(default_factory=list)

    def add_folder(self, folder: Path) -> None:
        """Search ``folder`` too. Raises PluginError when it is not a folder."""
        if not folder.is_dir():
            raise PluginError(f"robot folder {folder} does not exist")
        self.folders.append(folder)


@dataclass(frozen=True)
class NodeInfo:
    """A ROS node that a descriptor can name.

    Attributes:
        factory: ``package.module:name`` of what makes it, called as ``factory(robot, host)``
            and returning an ``rclpy.node.Node`` that the host is going to serve and destroy.
        summary: one line for people.
        enables_servos: with this node, joints and wheels are switched on at start.
        keeps_failed_start: clients of this node can repeat a failed start, so that the process
            goes on after one.
    """

    factory: str
    summary: str
    enables_servos: bool = False
    keeps_failed_start: bool = False


@dataclass
class NodeRegistry:
    """ROS nodes of plugins by name; imported only when a robot wants them."""

    nodes: dict[str, NodeInfo] = field(default_factory=dict)

    def add(
        self,
        name: str,
        factory: str,
        *,
        summary: str = "",
        enables_servos: bool = False,
        keeps_failed_start: bool = False,
    ) -> None:
        """Register a node. The arguments are those of ``NodeInfo``.

        An empty summary becomes the module's name. Raises PluginError when the name is taken.
        """
        if known := self.nodes.get(name):
            raise PluginError(f"node {name!r} is registered twice: {known.factory} and {factory}")
        summary = summary or f"by {factory.partition(':')[0]}"
        self.nodes[name] = NodeInfo(factory, summary, enables_servos, keeps_failed_start)
