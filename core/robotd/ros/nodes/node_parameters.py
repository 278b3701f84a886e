"""A node's parameters: the reference's default < the robot's descriptor < the command line.

Every parameter here is read once, while its node is made, and is read-only from then on: to set
one at run time is rejected by ROS with a reason. A wrong value is an error before
anything moves, by node, parameter, value and limit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.validate_full_topic_name import validate_full_topic_name

from robotd.descriptor import RobotDescriptor
from robotd.errors import DescriptorError, did_you_mean
from robotd.ros.middleware import overrides_of, remapped_action

_KINDS = {
    bool: ("true or false", "truth values"),
    int: ("a whole number", "whole numbers"),
    float: ("a number with a decimal point", "numbers with a decimal point"),
    str: ("a text", "texts"),
}


class Parameters:
    """Declares the read-only parameters of one node.

    Args:
        node: the owner, not yet served by an executor.
        descriptor: its section ``ros_parameters.<node>`` holds the defaults that differ.

    Every method raises DescriptorError for a value of the wrong type or outside its limits.
    """

    def __init__(self, node: Node, descriptor: RobotDescriptor) -> None:
        self._node = node
        self._descriptor = descriptor
        self._defaults = descriptor.ros_parameters.get(node.get_name(), {})
        self._declared: set[str] = set()

    def integer(self, name: str, default: int, limits: tuple[int, int], meaning: str) -> int:
        """A whole number within ``limits``, both included."""
        low, high = limits
        value = int(self._declare(name, default, f"{meaning}; {low} to {high}"))
        if not low <= value <= high:
            raise self.error(name, f"{value} is outside {low} to {high}")
        return value

    def number(self, name: str, default: float, meaning: str) -> float:
        """A finite number."""
        value = float(self._declare(name, float(default), meaning))
        if not -float("inf") < value < float("inf"):
            raise self.error(name, f"{value} is not a finite number")
        return value

    def positive(self, name: str, default: float, meaning: str) -> float:
        """A finite number above 0."""
        value = self.number(name, default, f"{meaning}; above 0")
        if value <= 0.0:
            raise self.error(name, f"{value} is not above 0")
        return value

    def numbers(self, name: str, default: Sequence[float], meaning: str) -> tuple[float, ...]:
        """As many finite numbers as the default has."""
        values = tuple(float(value) for value in self._declare(name, list(default), meaning))
        if len(values) != len(default):
            raise self.error(name, f"{len(values)} numbers instead of {len(default)}")
        if not all(map(math.isfinite, values)):
            raise self.error(name, f"{list(values)} are not all finite numbers")
        return values

    def flag(self, name: str, default: bool, meaning: str) -> bool:
        """True or false."""
        return bool(self._declare(name, default, meaning))

    def text(self, name: str, default: str, meaning: str) -> str:
        """Any text."""
        return str(self._declare(name, default, meaning))

    def texts(self, name: str, default: Sequence[str], meaning: str) -> tuple[str, ...]:
        """A list of texts."""
        return tuple(self._declare(name, list(default), meaning))

    def action(self, name: str, meaning: str) -> str:
        """Full name of an action, remapped by ``-r``."""
        return remapped_action(self._node, self.topic(name, meaning, required=True))

    def topic(self, name: str, meaning: str, *, required: bool = False) -> str:
        """Name of a topic or service; "" where it is not wanted and not required."""
        value = self.text(name, "", meaning if required else f"{meaning}; empty: none")
        if value:
            self._check_topic(name, value)
        elif required:
            raise self.error(name, "is empty, but needs a name")
        return value

    def file(self, name: str, meaning: str) -> Path | None:
        """Path of a file that exists; None where the parameter is empty."""
        path = self.text(name, "", meaning)
        if path and not Path(path).is_file():
            raise self.error(name, f"file {path!r} does not exist")
        return Path(path) if path else None

    def same_as(self, key: str, name: str, value: int | Sequence[str], meaning: str) -> None:
        """Declare a parameter that repeats ``key`` of the descriptor, whose value is ``value``.

        Raises DescriptorError, with both places, when the parameter says anything else.
        """
        known = value if isinstance(value, int) else list(value)
        given = self._declare(name, known, f"{meaning}, as the robot's descriptor has it")
        if given != known:
            raise self.error(name, f"{given} contradicts {key}: {known} ({self._origin(key)})")

    def done(self) -> None:
        """Reject what the descriptor gives and the node does not have."""
        for name in self._defaults:
            if name not in self._declared:
                hint = did_you_mean(name, self._declared)
                raise self.error(name, f"the node has no such parameter{hint}")

    def error(self, name: str, what: str) -> DescriptorError:
        """Return an error about parameter ``name``, with file and line where it has them."""
        key = f"{self._node.get_name()}.{name}"
        tree = self._descriptor.tree
        if tree is None or name not in self._defaults or name in overrides_of(self._node):
            return DescriptorError(what, key=key)
        value = tree.find(["ros_parameters", self._node.get_name(), name])
        return DescriptorError(what, path=value.path, line=value.line, key=key)

    def _origin(self, key: str) -> str:
        """The file and line of a key of the descriptor."""
        tree = self._descriptor.tree
        if tree is None:
            return "the robot's descriptor"
        node = tree.find(key.split("."))
        return str(node.path) if node.line is None else f"{node.path}:{node.line}"

    def _declare(self, name: str, reference: Any, meaning: str) -> Any:
        default = self._defaults.get(name, reference)
        if isinstance(reference, float) and type(default) is int:
            default = float(default)
        if type(default) is not type(reference):
            raise self._wrong_type(name, default, reference)
        descriptor = ParameterDescriptor(description=meaning, read_only=True)
        self._declared.add(name)
        try:
            return self._node.declare_parameter(name, default, descriptor).value
        except ParameterException as error:
            override = overrides_of(self._node)[name].value
            raise self._wrong_type(name, override, reference) from error

    def _wrong_type(self, name: str, value: Any, reference: Any) -> DescriptorError:
        if isinstance(reference, list):
            wanted = f"a list of {_KINDS[type(reference[0]) if reference else str][1]}"
        else:
            wanted = _KINDS[type(reference)][0]
        return self.error(name, f"{value!r} is not {wanted}")

    def _check_topic(self, name: str, value: str) -> None:
        try:
            validate_full_topic_name(self._node.resolve_topic_name(value, only_expand=True))
        except Exception as error:
            raise self.error(name, f"{value!r} is not a ROS name: {error}") from error
