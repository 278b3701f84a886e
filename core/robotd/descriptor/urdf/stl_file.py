"""Triangles of an STL file."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from robotd.arrays import FloatArray

_HEADER, _FACET = 84, 50  # bytes
_NUMBERS = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def stl_triangles(data: bytes) -> FloatArray:
    """Return the corners of an STL file, binary or text; shape (n, 3, 3).

    Raises ValueError: a number of the text, or the number of vertices, is wrong.
    """
    count = int.from_bytes(data[80:84], "little")
    if len(data) == _HEADER + count * _FACET:
        corners = np.frombuffer(data, _NUMBERS, offset=_HEADER)["points"]
        return corners.astype(np.float64)
    found = np.array([*_text_vertices(data)], dtype=np.float64)
    return found.reshape(-1, 3, 3)


def _text_vertices(data: bytes) -> Iterator[tuple[float, ...]]:
    for match in _VERTEX.finditer(data):
        yield tuple(float(number) for number in match.groups())
