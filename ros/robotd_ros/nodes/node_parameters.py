"""Declares a node's parameters, read-only from then on unless they are settable."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.validate_full_topic_name import validate_full_topic_name

from robotd.descriptor import RobotDescriptor
from robotd.descriptor.urdf import read_urdf_text
from robotd.plugin.parameter_reader import ParameterReader, WrongType
from robotd_ros.middleware import overrides_of

Settings = TypeVar("Settings")


def read_settings(
    node: Node,
    descriptor: RobotDescriptor,
    read: Callable[[ParameterReader, RobotDescriptor], Settings],
) -> Settings:
    """Declare the parameters of ``node`` by ``read``. Raises DescriptorError for wrong ones."""
    parameters = Parameters(node, descriptor)
    settings = read(parameters, descriptor)
    parameters.done()
    return settings


class Parameters(ParameterReader):
    """Reader that declares what it reads on a node; the command line goes first.

    Args:
        node: the owner, not yet served by an executor.
        descriptor: its section ``ros_parameters.<node>`` holds the defaults that differ.
    """

    def __init__(self, node: Node, descriptor: RobotDescriptor) -> None:
        super().__init__(node.get_name(), descriptor)
        self._node = node

    def action(self, name: str, meaning: str, default: str = "") -> str:
        """Full name of an action, remapped by ``-r``, which rcl of Jazzy does for topics only."""
        value = super().action(name, meaning, default)
        return str(self._node.resolve_topic_name(value)) if value else ""

    def _take(self, name: str, default: Any, meaning: str) -> Any:
        read_only = name not in self._settable
        descriptor = ParameterDescriptor(description=meaning, read_only=read_only)
        try:
            return self._node.declare_parameter(name, default, descriptor).value
        except ParameterException as error:
            given = overrides_of(self._node).get(name)
            raise WrongType("the given value" if given is None else given.value) from error

    def _own_description(self) -> str:
        """Return the robot's URDF. Raises DescriptorError where it cannot be read."""
        path = self._descriptor.urdf
        return read_urdf_text(path) if path else ""

    def _given(self, name: str) -> bool:
        return name in overrides_of(self._node) or super()._given(name)

    def _wrong_topic(self, value: str) -> str:
        try:
            validate_full_topic_name(self._node.resolve_topic_name(value, only_expand=True))
        except Exception as error:  # noqa: BLE001 - of several kinds
            return str(error)
        return ""

    def _place(self, name: str) -> tuple[Path | None, int | None]:
        return (None, None) if name in overrides_of(self._node) else super()._place(name)
