"""Input of all exports: a robot's ROS parameters, resolved topic names, and URDF."""

from __future__ import annotations

import posixpath
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robotd.api import DescriptorError, RobotDescriptor, read_urdf_text


@dataclass(frozen=True)
class ExportInput:
    """A robot's descriptor and the ROS ``namespace`` that it runs in (``/`` for none).

    Parameters that are changed on the command line of ``robotd run`` are not considered.
    """

    descriptor: RobotDescriptor
    namespace: str = "/"

    def parameter(self, node: str, name: str, default: Any) -> Any:
        """Return a node's parameter; ``default`` where the descriptor has none."""
        return self.descriptor.ros_parameters.get(node, {}).get(name, default)

    def topic(self, node: str, name: str, default: str = "") -> str:
        """Return the resolved topic name of a parameter; "" where it is empty."""
        value = str(self.parameter(node, name, default))
        if value.startswith("~/"):
            value = f"{node}/{value.removeprefix('~/')}"
        return posixpath.join(self.namespace, value) if value else ""

    def own_topic(self, node: str, name: str) -> str:
        """Return the resolved name of a topic ``~/name``.

        Raises DescriptorError where the robot has no such node.
        """
        if node not in self.descriptor.nodes:
            raise self.rejection(f"{self.descriptor.name} does not run the node {node}")
        return posixpath.join(self.namespace, node, name)

    def needed_topic(self, node: str, name: str, default: str = "") -> str:
        """Return ``topic``. Raises DescriptorError where the robot lacks the node or the name."""
        if node not in self.descriptor.nodes:
            raise self.rejection(f"{self.descriptor.name} does not run the node {node}")
        if topic := self.topic(node, name, default):
            return topic
        raise self.rejection(f"{self.descriptor.name}: parameter {node}.{name} is empty")

    def urdf(self) -> str:
        """Return the text of the robot's URDF. Raises DescriptorError: missing or not XML."""
        return read_urdf_text(self.urdf_path())

    def urdf_path(self) -> Path:
        """Return the file of the robot's URDF. Raises DescriptorError: it has none."""
        path = self.descriptor.urdf
        if path is None:
            raise self.rejection(f"{self.descriptor.name} has no urdf")
        return path

    def rejection(self, reason: str) -> DescriptorError:
        """Return an error about the descriptor, ready to be raised."""
        return DescriptorError(reason, path=self.descriptor.path)

    def document(self, lines: Iterable[str], content: dict[str, Any]) -> str:
        """Return ``content`` as YAML, with its origin and ``lines`` as leading comments."""
        variant = f" (variant {self.descriptor.variant})" if self.descriptor.variant else ""
        origin = f"Made by 'robotd export' from the descriptor of {self.descriptor.name}{variant}."
        head = "".join(f"# {line}\n" for line in (origin, *lines))
        return head + yaml.dump(content, Dumper=_Dumper, sort_keys=False, width=100)


class _Dumper(yaml.SafeDumper):
    """Block mappings and flow sequences, as ROS parameter files are written."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        return super().represent_sequence(tag, sequence, flow_style=_is_plain(sequence))

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _is_plain(sequence: Iterable[Any]) -> bool:
    return not any(isinstance(item, dict) for item in sequence)
