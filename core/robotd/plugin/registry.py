"""Where plugins put the robots and nodes that they bring; a clash stops the start-up."""

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


@dataclass
class NodeRegistry:
    """ROS nodes by name: ``"package.module:factory"``, imported only when a robot wants it."""

    factories: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, factory: str) -> None:
        """Register a node. Raises PluginError when the name is taken."""
        if name in self.factories:
            raise PluginError(
                f"node {name!r} is registered twice: {self.factories[name]} and {factory}"
            )
        self.factories[name] = factory
