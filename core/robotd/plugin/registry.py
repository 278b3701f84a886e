"""Registries of robots and nodes from plugins; a clash stops the start-up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from pkgutil import resolve_name

from robotd.descriptor import RobotDescriptor
from robotd.errors import DescriptorError, PluginError, RobotdError, unknown_name
from robotd.plugin.parameter_reader import ParameterReader

_BUILT_IN = "robotd_ros."  # begins the factories of built-in nodes


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
        parameters: ``package.module:name`` of a function that reads the node's parameters, called
            as ``read(reader, descriptor)`` with a ``ParameterReader``; ``robotd check`` imports
            it without ROS. "": the parameters are not checked.
    """

    factory: str
    summary: str
    enables_servos: bool = False
    keeps_failed_start: bool = False
    parameters: str = ""


@dataclass
class NodeRegistry:
    """ROS nodes by name, built-in and of plugins; imported only when a robot wants them.

    Attributes:
        nodes: by name.
        server: ``package.module:function`` that serves a robot's nodes until the process is told
            to stop, as ``robotd_ros.serve:serve``; "" where no plugin does.
    """

    nodes: dict[str, NodeInfo] = field(default_factory=dict)
    server: str = ""

    def serve_with(self, function: str) -> None:
        """Set ``server``. Raises PluginError when another plugin has set it."""
        if self.server not in ("", function):
            raise PluginError(f"nodes are served by {self.server} and by {function}")
        self.server = function

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

        An empty summary becomes the module's name. Raises PluginError when the name is taken.
        """
        if known := self.nodes.get(name):
            others = [made for made in (known.factory, factory) if not made.startswith(_BUILT_IN)]
            if len(others) == 1:
                raise PluginError(f"node {name!r} of {others[0]} has the name of a built-in node")
            raise PluginError(f"node {name!r} is registered twice: {known.factory} and {factory}")
        summary = summary or f"by {factory.partition(':')[0]}"
        self.nodes[name] = NodeInfo(
            factory, summary, enables_servos, keeps_failed_start, parameters
        )

    def select(self, names: Iterable[str]) -> dict[str, NodeInfo]:
        """Return the nodes with these names, in this order.

        Raises DescriptorError, with the nearest name, for every node that does not exist.
        """
        names = list(names)
        problems = [
            DescriptorError(unknown_name("node", name, self.nodes), key="nodes")
            for name in names
            if name not in self.nodes
        ]
        if problems:
            raise DescriptorError.join(problems)
        return {name: self.nodes[name] for name in names}

    def with_backend(self, others: NodeRegistry) -> NodeRegistry:
        """Return these nodes and those of a backend. Raises PluginError as ``add``."""
        both = NodeRegistry(dict(self.nodes), self.server)
        for name, info in others.nodes.items():
            if both.nodes.get(name) == info:  # the backend is a plugin, too
                continue
            both.add(name, **vars(info))
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
            try:
                resolve_name(info.parameters)(reader, descriptor)
            except DescriptorError as error:
                problems.append(error)
            except RobotdError:
                raise
            except Exception as error:
                what = f"parameters of node {name!r} cannot be read by {info.parameters}"
                raise PluginError(f"{what}: {type(error).__name__}: {error}") from error
            problems += reader.problems()
        if problems:
            raise DescriptorError.join(problems)
