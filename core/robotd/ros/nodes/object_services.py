"""Services that read and write objects (SDO) of the nodes of a fieldbus."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node

from robotd.device.fieldbus import Fieldbus
from robotd.device.object_text import object_text
from robotd.errors import InvalidArgument
from robotd.ros.host import RosHost
from robotd.ros.services import add_service, named_values

READ, WRITE = "wmx/ecat/read_object", "wmx/ecat/write_object"
OBJECT = ("slave_id", "index", "subindex")
MAX_SIZE = 8


class ObjectServices:
    """``read_object`` and ``write_object``; the answer is the value in the node, as text."""

    def __init__(self, node: Node, host: RosHost, fieldbus: Fieldbus) -> None:
        self._fieldbus = fieldbus
        for name, handler in ((READ, self._read), (WRITE, self._write)):
            add_service(node, host, SetParametersAtomically, name, named_values(handler))

    def _read(self, fields: dict[str, Any]) -> str:
        numbers = whole_numbers(fields, OBJECT, {"master_id": 0})
        return object_text(self._fieldbus.read_object(*address(numbers)))

    def _write(self, fields: dict[str, Any]) -> str:
        numbers = whole_numbers(fields, (*OBJECT, "value"), {"master_id": 0, "size": 0})
        where = address(numbers)
        size = numbers["size"] or len(self._fieldbus.read_object(*where))
        self._fieldbus.write_object(*where, little_endian(numbers["value"], size))
        return object_text(self._fieldbus.read_object(*where))


def whole_numbers(
    fields: Mapping[str, Any], required: tuple[str, ...], optional: Mapping[str, int]
) -> dict[str, int]:
    """Return the values of a request. Raises InvalidArgument for a missing or unknown one."""
    numbers = {**optional, **fields}
    known = {*required, *optional}
    if known != numbers.keys() or any(type(each) is not int for each in numbers.values()):
        wanted = ", ".join((*required, *(f"[{name}]" for name in optional)))
        raise InvalidArgument(f"expected the whole numbers {wanted}; got {dict(fields)}")
    return numbers


def address(numbers: Mapping[str, int]) -> tuple[int, int, int, int]:
    """Return bus, node, index and subindex of a request."""
    return numbers["master_id"], numbers["slave_id"], numbers["index"], numbers["subindex"]


def little_endian(value: int, size: int) -> bytes:
    """Return ``size`` bytes of ``value``, signed or not. Raises InvalidArgument."""
    if not 1 <= size <= MAX_SIZE:
        raise InvalidArgument(f"size {size} is outside 1..{MAX_SIZE} bytes")
    limit = 1 << 8 * size
    if not -limit // 2 <= value < limit:
        raise InvalidArgument(f"value {value} does not fit in {size} bytes")
    return (value % limit).to_bytes(size, "little")
