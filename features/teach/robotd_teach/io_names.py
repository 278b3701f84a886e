"""Inputs and outputs by their names in the robot's file, or as byte.bit."""

from __future__ import annotations

import re
from collections.abc import Mapping

from robotd.api import InvalidArgument, unknown_name

BIT = re.compile(r"([0-9]{1,4})\.([0-7])")


def bit_of(
    kind: str, name: str, known: Mapping[str, tuple[int, int]], size: int
) -> tuple[int, int]:
    """Return byte and bit of an input or output.

    Args:
        kind: "input" or "output".
        name: of the robot's file, or byte.bit.
        known: addresses by name.
        size: of the image, bytes.

    Raises InvalidArgument: unknown, or outside of the image.
    """
    if match := BIT.fullmatch(name):
        byte, bit = int(match[1]), int(match[2])
        if byte >= size:
            has = f"the last byte is {size - 1}" if size else f"the device has no {kind}s"
            raise InvalidArgument(f"{name} is outside the image of {kind}s: {has}")
        return byte, bit
    if name not in known:
        raise InvalidArgument(unknown_name(kind, name, known))
    return known[name]
