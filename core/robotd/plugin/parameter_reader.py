"""A node's parameters: the reference's default < the robot's descriptor < the command line.

Every parameter is read once, while its node is made. A wrong value is an error before anything
moves, by node, parameter, value and limit; all of them are reported at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robotd.descriptor import RobotDescriptor
from robotd.errors import DescriptorError, did_you_mean

_KINDS = {
    bool: ("true or false", "truth values"),
    int: ("a whole number", "whole numbers"),
    float: ("a number with a decimal point", "numbers with a decimal point"),
    str: ("a text", "texts"),
}
_ROS_NAME = re.compile(r"~?/?[A-Za-z_{][\w{}]*(/[A-Za-z_{][\w{}]*)*|~")


class WrongType(Exception):
    """The value of a parameter has another type than its default."""

    def __init__(self, value: Any) -> None:
        super().__init__(value)
        self.value = value


def wrong_frame(name: str) -> str:
    """Return why tf cannot have a frame of this name; "" if it can."""
    if not name:
        return "it is empty"
    if name.startswith("/"):
        return "tf allows no leading /"
    return "it has a space" if re.search(r"\s", name) else ""


def no_parameters(reader: ParameterReader, descriptor: RobotDescriptor) -> None:
    """Declare nothing: any parameter in the descriptor is a mistake."""


class ParameterReader:
    """Reads the parameters of one node from the robot's descriptor, without ROS.

    A parameter that is wrong is recorded, and read as its default; ``done`` raises.

    ``descriptor``: its section ``ros_parameters.<node>`` holds the defaults that differ.
    """

    def __init__(self, node: str, descriptor: RobotDescriptor) -> None:
        self.node = node
        self._descriptor = descriptor
        self._defaults = descriptor.ros_parameters.get(node, {})
        self._declared: set[str] = set()
        self._settable: set[str] = set()
        self._problems: list[DescriptorError] = []

    def integer(self, name: str, default: int, limits: tuple[int, int], meaning: str) -> int:
        """A whole number within ``limits``, both included."""
        low, high = limits
        value = int(self._declare(name, default, f"{meaning}; {low} to {high}"))
        if not low <= value <= high:
            self.reject(name, f"{value} is outside {low} to {high}")
        return value

    def number(self, name: str, default: float, meaning: str) -> float:
        """A finite number."""
        value = float(self._declare(name, float(default), meaning))
        if not math.isfinite(value):
            self.reject(name, f"{value} is not a finite number")
            return default
        return value

    def settable(self, name: str, default: float, meaning: str) -> float:
        """A finite number of at least 0 that may be set at run time."""
        self._settable.add(name)
        value = self.number(name, default, f"{meaning}; 0: not checked")
        if value < 0.0:
            self.reject(name, f"{value} is less than 0")
            return default
        return value

    def positive(self, name: str, default: float, meaning: str) -> float:
        """A finite number above 0."""
        value = self.number(name, default, f"{meaning}; above 0")
        if value <= 0.0:
            self.reject(name, f"{value} is not above 0")
            return default
        return value

    def numbers(self, name: str, default: Sequence[float], meaning: str) -> tuple[float, ...]:
        """Declare a list of as many finite numbers as the default has."""
        values = tuple(float(value) for value in self._declare(name, list(default), meaning))
        if len(values) != len(default):
            self.reject(name, f"{len(values)} numbers instead of {len(default)}")
        elif not all(map(math.isfinite, values)):
            self.reject(name, f"{list(values)} are not all finite numbers")
        else:
            return values
        return tuple(default)

    def flag(self, name: str, default: bool, meaning: str) -> bool:
        """True or false."""
        return bool(self._declare(name, default, meaning))

    def settable_flag(self, name: str, default: bool, meaning: str) -> bool:
        """True or false, which may be set at run time."""
        self._settable.add(name)
        return self.flag(name, default, meaning)

    def frame(self, name: str, default: str, meaning: str, prefix: str = "") -> str:
        """Name of a frame of tf, with ``prefix``, which is checked where it is declared."""
        value = self.text(name, default, meaning)
        if wrong := wrong_frame(value):
            self.reject(name, f"{value!r} is not a valid name of a frame: {wrong}")
        return prefix + value

    def text(self, name: str, default: str, meaning: str) -> str:
        """Any text."""
        return str(self._declare(name, default, meaning))

    def action(self, name: str, meaning: str, default: str = "") -> str:
        """Name of an action."""
        return self.topic(name, meaning, default, required=True)

    def topic(self, name: str, meaning: str, default: str = "", *, required: bool = False) -> str:
        """Name of a topic or service; "" where it is not wanted and not required."""
        value = self.text(name, default, meaning if required else f"{meaning}; empty: none")
        if value and (wrong := self._wrong_topic(value)):
            self.reject(name, f"{value!r} is not a ROS name: {wrong}")
        elif required and not value:
            what = "is empty, but" if self._given(name) else "missing,"
            where = f"under ros_parameters.{self.node} of the robot, or by -p {name}:=NAME"
            self.reject(name, f"{what} needs a name ({meaning}): set it {where}")
        return value

    def description(self) -> str:
        """The URDF that the node publishes; "" for none."""
        own = self._own_description()
        return self.text("robot_description", own, "the URDF; empty: not published")

    def file(self, name: str, meaning: str) -> Path | None:
        """Path of a file that exists; None where the parameter is empty."""
        path = self.text(name, "", meaning)
        if path and not Path(path).is_file():
            self.reject(name, f"file {path!r} does not exist")
        return Path(path) if path else None

    def same_as(
        self, key: str, name: str, value: int | Sequence[str] | Sequence[int], meaning: str
    ) -> None:
        """Declare a parameter that repeats ``key`` of the descriptor, whose value is ``value``.

        One that says anything else is rejected with both places.
        """
        known = value if isinstance(value, int) else list(value)
        given = self._declare(name, known, f"{meaning}, as the robot's descriptor has it")
        given = given if isinstance(known, int) else list(given)
        if given != known:
            self.reject(name, f"{given} contradicts {key}: {known} ({self._origin(key)})")

    def reject(self, name: str, what: str) -> None:
        """Note a problem of parameter ``name``, with file and line where it has them."""
        path, line = self._place(name)
        key = f"{self.node}.{name}"
        self._problems.append(DescriptorError(what, path=path, line=line, key=key))

    def problems(self) -> list[DescriptorError]:
        """Return all problems, and parameters of the descriptor that the node does not have."""
        unknown = [name for name in self._defaults if name not in self._declared]
        for name in unknown:
            hint = did_you_mean(name, self._declared)
            self.reject(name, f"the node has no such parameter{hint}")
        self._declared.update(unknown)
        return self._problems

    def done(self) -> None:
        """Raise DescriptorError, with all problems, unless every parameter is right."""
        if problems := self.problems():
            raise DescriptorError.join(problems)

    def _take(self, name: str, default: Any, meaning: str) -> Any:
        """Return the value of a parameter; WrongType where it has not that of ``default``."""
        del name, meaning
        return default

    def _own_description(self) -> str:
        """Return the robot's URDF; its file is checked elsewhere."""
        return ""

    def _given(self, name: str) -> bool:
        return name in self._defaults

    def _wrong_topic(self, value: str) -> str:
        """Return why ``value`` is not a valid name of a topic; "" if it is one."""
        return "" if _ROS_NAME.fullmatch(value.removeprefix("/")) else "wrong characters"

    def _declare(self, name: str, reference: Any, meaning: str) -> Any:
        default = self._defaults.get(name, reference)
        if isinstance(reference, float) and type(default) is int:
            default = float(default)
        self._declared.add(name)
        if type(default) is type(reference):
            try:
                return self._take(name, default, meaning)
            except WrongType as error:
                default = error.value
        if isinstance(reference, list):
            wanted = f"a list of {_KINDS[type(reference[0]) if reference else str][1]}"
        else:
            wanted = _KINDS[type(reference)][0]
        self.reject(name, f"{default!r} is not {wanted}")
        return reference

    def _place(self, name: str) -> tuple[Path | None, int | None]:
        """File and line of a parameter, or of where it is missing."""
        tree = self._descriptor.tree
        if tree is None:
            return None, None
        found = tree.find(["ros_parameters", self.node, name])
        return found.path, found.line

    def _origin(self, key: str) -> str:
        """The file and line of a key of the descriptor."""
        tree = self._descriptor.tree
        if tree is None:
            return "the robot's descriptor"
        node = tree.find(key.split("."))
        return str(node.path) if node.line is None else f"{node.path}:{node.line}"
