"""Registries of robots and nodes from plugins; a clash stops the start-up."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from pkgutil import resolve_name

from pydantic.dataclasses import dataclass as pydantic_dataclass

from robotd.descriptor import RobotDescriptor
from robotd.entry_points import OWNER, PluginOrigin, plugin_errors, rivals
from robotd.errors import DescriptorError, PluginError, unknown_name
from robotd.feature import OptionalTarget, Target
from robotd.plugin.parameter_reader import ParameterReader

_NODE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@dataclass
class RobotRegistry:
    """Folders that hold ``<name>/robot.yaml``, in the order in which they are searched."""

    folders: list[Path] = field(default_factory=list)

    def add_folder(self, folder: Path) -> None:
        """Search ``folder`` too. Raises PluginError when it is not a folder."""
        if not isinstance(folder, Path):
            raise PluginError(f"robot folder must be a Path (value {folder!r:.60})")
        if not folder.is_dir():
            raise PluginError(f"robot folder {folder} does not exist")
        self.folders.append(folder)


@pydantic_dataclass(frozen=True)
class NodeInfo:
    """A ROS node that a descriptor can name.

    Attributes:
        factory: ``package.module:name`` of what makes it, called as ``factory(robot, host)``
            and returning an ``rclpy.node.Node`` that the host is going to serve and destroy.
        summary: one line for people.
        enables_servos: with this node, joints and wheels are switched on at start.
        keeps_failed_start: clients of this node can repeat a failed start, so that the process
            goes on after one.
        parameters: ``package.module:name`` of a function that reads the node's parameters, called
            as ``read(reader, descriptor)`` with a ``ParameterReader``; ``robotd check`` imports
            it without ROS. "": the parameters are not checked.
        owner: plugin that has registered it, for texts.
    """

    factory: Target
    summary: str
    enables_servos: bool = False
    keeps_failed_start: bool = False
    parameters: OptionalTarget = ""
    owner: str = ""


@dataclass
class NodeRegistry:
    """ROS nodes by name, built-in and of plugins; imported only when a robot wants them.

    Attributes:
        nodes: by name.
        server: ``package.module:function`` that serves a robot's nodes until the process is
            asked to stop, as ``robotd_ros.serve:serve``; "" where no plugin does.
        served: names of nodes that the server makes besides those of the robot.
        owner: plugin that registers its nodes here, for texts.
        refused: why nodes are left out, by name.
    """

    nodes: dict[str, NodeInfo] = field(default_factory=dict)
    server: str = ""
    served: tuple[str, ...] = ()
    owner: str = ""
    refused: dict[str, str] = field(default_factory=dict)

    def serve_with(self, function: str, names: Iterable[str] = ()) -> None:
        """Set ``server`` and ``served``. Raises PluginError when another one is set."""
        if self.server not in ("", function):
            raise PluginError(f"nodes are served by {self.server} and by {function}")
        self.server, self.served = function, tuple(names)

    def add(
        self,
        name: str,
        factory: str,
        *,
        summary: str = "",
        enables_servos: bool = False,
        keeps_failed_start: bool = False,
        parameters: str = "",
    ) -> None:
        """Register a node. The arguments are those of ``NodeInfo``.

        An empty summary becomes the module's name. Raises PluginError: the name is none, or taken
        in this registry; ValidationError: another argument is wrong.
        """
        if not _NODE_NAME.fullmatch(str(name)):
            what = "letters, digits and _, no digit first"
            raise PluginError(f"the name of a node must be {what} (value {name!r:.60})")
        if known := self.nodes.get(name):
            raise PluginError(f"node {name!r} is registered twice: {known.factory} and {factory}")
        summary = summary or f"by {str(factory).partition(':')[0]}"
        self.nodes[name] = NodeInfo(
            factory, summary, enables_servos, keeps_failed_start, parameters, self.owner
        )

    @classmethod
    def joined(
        cls, made: Mapping[PluginOrigin, NodeRegistry], failures: dict[PluginOrigin, str]
    ) -> NodeRegistry:
        """Return the nodes of several plugins, by the rule of ``rivals``.

        ``failures``: gets why plugins lack nodes, in addition to what is in it.
        """
        joined = cls()
        for origin, registered in made.items():
            if registered.server:
                try:
                    joined.serve_with(registered.server, registered.served)
                except PluginError as error:
                    failures[origin] = f"plugin {origin}: {error}"
        claims = [(name, OWNER) for name in joined.served]
        claims += [
            (name, origin) for origin, registered in made.items() for name in registered.nodes
        ]
        taken = rivals(claims)
        for origin, registered in made.items():
            joined.nodes |= {
                name: info for name, info in registered.nodes.items() if (name, origin) not in taken
            }
        for (name, origin), other in taken.items():
            text = f"plugin {origin}: node {name!r} is taken by {other}"
            joined.refused[name] = text
            failures[origin] = "\n".join(filter(None, (failures.get(origin), text)))
        return joined

    def select(self, names: Iterable[str]) -> dict[str, NodeInfo]:
        """Return the nodes with these names, in this order.

        Raises DescriptorError, with the nearest name, for every node that does not exist.
        """
        names = list(names)
        problems = [
            DescriptorError(
                self.refused.get(name) or unknown_name("node", name, self.nodes), key="nodes"
            )
            for name in names
            if name not in self.nodes
        ]
        if problems:
            raise DescriptorError.join(problems)
        return {name: self.nodes[name] for name in names}

    def with_backend(self, others: NodeRegistry) -> NodeRegistry:
        """Return these nodes and those of a backend. Raises PluginError: a name is taken."""
        both = replace(self, nodes=dict(self.nodes))
        for name, info in others.nodes.items():
            known = both.nodes.get(name)
            if known and known.factory != info.factory:  # else the backend is a plugin, too
                raise PluginError(f"node {name!r} of plugin {info.owner} is taken by {known.owner}")
            both.nodes.setdefault(name, info)
        return both

    def check_parameters(self, descriptor: RobotDescriptor) -> None:
        """Check ``ros_parameters`` of those of the robot's nodes that bring a reader.

        Raises:
            DescriptorError: all missing, unknown and wrong parameters, with file and line.
            PluginError: a reader cannot be imported or fails.
        """
        problems: list[DescriptorError] = []
        for name in descriptor.nodes:
            info = self.nodes.get(name)
            if info is None or not info.parameters:
                continue
            reader = ParameterReader(name, descriptor)
            what = f"parameters of node {name!r} of plugin {info.owner}: {info.parameters}"
            try:
                with plugin_errors(what, info.parameters):
                    resolve_name(info.parameters)(reader, descriptor)
            except DescriptorError as error:
                problems.append(error)
            problems += reader.problems()
        if problems:
            raise DescriptorError.join(problems)
