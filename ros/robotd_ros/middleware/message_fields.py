"""Numeric fields of a ROS message instance, addressed by a dotted path.

A path names a number (``pose.pose.position.x``), an array (``position``), an element of an
array of messages (``transforms.0.transform``) or a message. A message stands for all numbers in
it, in the order of its definition; they must be of one type, so ``pose.pose.orientation`` is four
float64. Names and types come from the generated class, so a field cannot be described wrongly.
Part of ``cdr.py``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotd_messages.cdr_stream import CdrWriter

# Primitive types of the ROS 2 interface language and what rosidl maps them to.
_DTYPES = {
    "boolean": np.dtype(np.bool_),
    "float": np.dtype(np.float32),
    "double": np.dtype(np.float64),
    "char": np.dtype(np.uint8),
    **{name: np.dtype(name) for bits in (8, 16, 32, 64) for name in (f"int{bits}", f"uint{bits}")},
}
_TIME_TYPE = "builtin_interfaces/Time"


@dataclass(frozen=True, slots=True)
class _Slot:
    """One attribute of one message object: a number, or an array of them."""

    owner: Any
    name: str
    dtype: np.dtype[Any]
    length: int | None  # None: a single number

    @property
    def count(self) -> int:
        return 1 if self.length is None else self.length

    def get(self) -> NDArray[Any]:
        return np.atleast_1d(np.asarray(getattr(self.owner, self.name), dtype=self.dtype))

    def set(self, values: NDArray[Any]) -> None:
        plain = values.tolist()
        setattr(self.owner, self.name, plain[0] if self.length is None else plain)


class MessageField:
    """The numbers that one path means in one message instance.

    Attributes:
        path: the path as given.
        dtype: type of every number.
        count: how many numbers there are; constant, because lengths in the message are.

    Raises ValueError: the path does not exist, or does not mean numbers of one type.
    """

    def __init__(self, message: Any, path: str) -> None:
        self.path = path
        self._slots = list(_slots(message, path))
        dtypes = {slot.dtype for slot in self._slots}
        if len(dtypes) != 1:
            raise ValueError(f"{type(message).__name__}.{path}: not numbers of one type")
        self.dtype: np.dtype[Any] = dtypes.pop()
        self.count = sum(slot.count for slot in self._slots)

    def get(self) -> NDArray[Any]:
        """A copy of the numbers, shape (count,)."""
        return np.concatenate([slot.get() for slot in self._slots])

    def set(self, values: NDArray[Any]) -> None:
        """Assign ``values`` of shape (count,) to the message."""
        start = 0
        for slot in self._slots:
            slot.set(values[start : start + slot.count])
            start += slot.count


def time_paths(message: Any, prefix: str = "") -> Iterator[str]:
    """Paths of every ``builtin_interfaces/Time`` in the message, at any depth."""
    for name, type_name in message.get_fields_and_field_types().items():
        if "/" not in type_name:
            continue
        value = getattr(message, name)
        elements = enumerate(value) if isinstance(value, list | tuple) else [(None, value)]
        for index, element in elements:
            path = f"{prefix}{name}" if index is None else f"{prefix}{name}.{index}"
            if _element_type(type_name) == _TIME_TYPE:
                yield path
            else:
                yield from time_paths(element, f"{path}.")


class MessageEncoder(CdrWriter):
    """CDR of a message, and the places of its numbers.

    Attributes:
        offsets: of each number, or array of numbers, by its path.
        padding: offsets of the bytes without a meaning.

    Raises ValueError: the message has a field of a type that is not known here, such as wstring.
    """

    def __init__(self, message: Any) -> None:
        super().__init__()
        self.offsets: dict[str, int] = {}
        self.padding: list[int] = []
        self._add(message, "")

    def is_in(self, data: bytes) -> bool:
        """Return True where ``data`` is the same message; there may be bytes after it."""
        own, other = bytearray(self.payload()), bytearray(data[: len(self.payload())])
        for offset in self.padding:  # not initialized by the middleware
            own[offset : offset + 1] = other[offset : offset + 1]
        return own == other

    def _add(self, message: Any, prefix: str) -> None:
        for name, type_name in message.get_fields_and_field_types().items():
            path, value, element = (
                f"{prefix}{name}",
                getattr(message, name),
                _element_type(type_name),
            )
            is_array = element != type_name
            if is_array and type_name.startswith("sequence"):
                self.number("I", len(value))
            elements = value if is_array else [value]
            if (dtype := _DTYPES.get(element)) is not None:
                self.offsets[path] = self.array(np.asarray(elements, dtype))
            elif element == "string":
                for text in elements:
                    self.string(text)
            elif "/" in element:
                for index, item in enumerate(elements):
                    self._add(item, f"{path}.{index}." if is_array else f"{path}.")
            else:
                raise ValueError(f"{path}: {type_name} is not known")

    def _align(self, size: int) -> int:
        begin, end = len(self._data), super()._align(size)
        self.padding += range(begin, end)
        return end


def _slots(message: Any, path: str) -> Iterator[_Slot]:
    owner: Any = message
    *parents, last = path.split(".")
    try:
        for part in parents:
            owner = owner[int(part)] if part.isdigit() else getattr(owner, part)
        value = owner[int(last)] if last.isdigit() else getattr(owner, last)
    except (AttributeError, IndexError, TypeError) as error:
        raise ValueError(f"{type(message).__name__} has no field {path}") from error
    if hasattr(value, "get_fields_and_field_types"):
        yield from _slots_of_message(value)
    elif last.isdigit():
        raise ValueError(f"{type(message).__name__}.{path}: name the array, not its element")
    else:
        yield _slot(owner, last, path)


def _slots_of_message(message: Any) -> Iterator[_Slot]:
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            yield from _slots_of_message(value)
        else:
            yield _slot(message, name, name)


def _slot(owner: Any, name: str, path: str) -> _Slot:
    type_name = owner.get_fields_and_field_types()[name]
    dtype = _DTYPES.get(_element_type(type_name))
    if dtype is None:
        raise ValueError(f"{type(owner).__name__}.{path}: {type_name} is not numeric")
    value = getattr(owner, name)
    return _Slot(owner, name, dtype, len(value) if hasattr(value, "__len__") else None)


def _element_type(type_name: str) -> str:
    """``sequence<double, 8>`` and ``double[8]`` are made of ``double``."""
    return re.sub(r"^sequence<([^,>]+).*$|\[\d+\]$", lambda found: found[1] or "", type_name)
