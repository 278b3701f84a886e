"""Messages of any ROS type with random content: undefined enumerations, empty, huge, NaN."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from rosidl_parser.definition import (
    AbstractNestedType,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)

# No command with one of these can be executed, so that a random one moves nothing. Those that are
# finite and too large can: a stream clips them to the limits of the joint.
NO_NUMBERS = (math.nan, math.inf, -math.inf)
NUMBERS = (*NO_NUMBERS, 1e308, -1e308, 0.0, -0.0, 1.0, -1.0, 1e-300, 0.5, 3.14, 1e9)
TEXTS = ("", " ", "\x1b[2J", "../" * 2000, "x" * 300, "y" * 50_000, "/dev/zero", "/proc/self/mem")
NAMES = (
    *("joint1", "joint6", "speed", "periods", "index", "subindex", "axis", "value", "kind"),
    *("use_sim_time", "constraints.goal_time", "constraints.joint1.goal", "world", "tool0"),
)
LENGTHS = (0, 1, 2, 6, 6, 7, 50, 5_000)
MADE = 7  # elements of a sequence; they are repeated
MAX_FLOAT = 3e38
LIKELY_ARRAYS, MAX_MESSAGES = 2, 30


def type_named(name: str) -> Any:
    """The class of a type as the graph names it; of a part of an action, its service."""
    package, kind, word = name.split("/")
    word, _, part = word.partition("_") if kind == "action" else (word, "", "")
    found = getattr(import_module(f"{package}.{kind}"), word)
    return getattr(found.Impl, f"{part}Service") if part else found


def message_class(kind: NamespacedType) -> Any:
    """The class of a message, or of the goal of an action."""
    word, _, part = kind.name.partition("_")
    found = getattr(import_module(".".join(kind.namespaces)), word)
    return getattr(found, part) if part else found


class RandomMessages:
    """Makes random messages, the same ones for the same ``seed``."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def filled(self, message: Any, *, is_command: bool) -> Any:
        """Return ``message`` with all fields filled.

        Args:
            is_command: of a topic or an action: its floating-point numbers are ``NO_NUMBERS``.
        """
        numbers = NO_NUMBERS if is_command else NUMBERS
        fields = message.get_fields_and_field_types()
        for field, kind in zip(fields, message.SLOT_TYPES, strict=True):
            setattr(message, field, self._value(kind, numbers))
        return message

    def _value(self, kind: Any, numbers: Sequence[float]) -> Any:
        if isinstance(kind, AbstractNestedType):
            return self._values(kind, numbers)
        if isinstance(kind, NamespacedType):
            return self.filled(message_class(kind)(), is_command=numbers is NO_NUMBERS)
        if isinstance(kind, AbstractString):
            return self.random.choice(TEXTS if self.random.random() < 0.5 else NAMES)
        return self._basic(kind, numbers)

    def _values(self, kind: Any, numbers: Sequence[float]) -> list[Any]:
        if isinstance(kind, Array):
            return [self._value(kind.value_type, numbers) for _ in range(kind.size)]
        length = self.random.choice(LENGTHS)
        if isinstance(kind.value_type, NamespacedType):
            length = min(length, LIKELY_ARRAYS if self.random.random() < 0.9 else MAX_MESSAGES)
        elif isinstance(kind.value_type, AbstractString):
            length = min(length, MAX_MESSAGES)
        length = min(length, getattr(kind, "maximum_size", length))
        made = [self._value(kind.value_type, numbers) for _ in range(min(length, MADE))]
        return (made * (length // MADE + 1))[:length]

    def _basic(self, kind: BasicType, numbers: Sequence[float]) -> Any:
        choose, name = self.random.choice, kind.typename
        if name == "boolean":
            return choose((False, True))
        if name == "octet":
            return bytes([self.random.randrange(256)])
        if name in ("float", "double"):
            number = choose(numbers)
            return math.inf if name == "float" and abs(number) > MAX_FLOAT else number
        bits = int(name.removeprefix("u").removeprefix("int"))
        low = 0 if name.startswith("u") else -(2 ** (bits - 1))
        high = low + 2**bits - 1
        few = [number for number in range(-1, 12) if low <= number]
        return choose([*few, low, high, self.random.randint(low, high)])
