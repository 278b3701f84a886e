"""Geometry of the links of a URDF: pose and size of shapes, triangles of STL files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import DescriptorError, FloatArray
from robotd.api.models import find_mesh, frame, read_limited
from robotd_shared.mesh_files import MAX_MESH_BYTES

_HEADER, _FACET = 84, 50  # bytes
_NUMBERS = np.dtype([("normal", "<f4", 3), ("points", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def numbers(element: Any, key: str, count: int, default: str = "") -> FloatArray:
    """Return the ``count`` numbers of an attribute; ``element`` None has the default ones.

    Raises DescriptorError for fewer or more, and for one that is not finite.
    """
    text = default if element is None else element.get(key, default)
    try:
        found = np.array([float(number) for number in text.split()])
    except ValueError:
        found = np.empty(0)
    if found.shape != (count,) or not np.isfinite(found).all():
        needed = "1 finite number" if count == 1 else f"{count} finite numbers"
        what = f"{key} of {element.tag} is {text!r}, must be {needed}"
        raise DescriptorError(f"link {_link_of(element)!r}: {what}")
    return found


def _link_of(element: Any) -> str:
    return str(next(element.iterancestors("link")).get("name", ""))


def shape_pose(shape: Any) -> FloatArray:
    """Return the pose (4, 4), m, of a ``collision`` or ``visual`` in its link."""
    origin = shape.find("origin")
    return frame(numbers(origin, "xyz", 3, "0 0 0"), numbers(origin, "rpy", 3, "0 0 0"))


def mesh_triangles(mesh: Any, path: Path) -> FloatArray:
    """Return the corners (n, 3, 3) of the scaled mesh of a shape, m.

    Args:
        mesh: the element in ``geometry``.
        path: of the URDF, which a relative name starts from.

    Raises DescriptorError: it is not an STL file, or one that cannot be read or has no triangles.
    """
    link = f"link {_link_of(mesh)!r}"
    name = mesh.get("filename", "")
    file = find_mesh(name, path)
    if mesh.tag != "mesh" or file is None or file.suffix.lower() != ".stl":
        what = f"{mesh.tag} {name} cannot be read: boxes, cylinders, spheres and STL files can"
        raise DescriptorError(f"{link}: {what}", path=path)
    try:
        triangles = _stl_triangles(read_limited(file, MAX_MESH_BYTES))
    except ValueError as error:
        raise DescriptorError(f"{link}: {error}", path=file) from error
    if not len(triangles) or not np.isfinite(triangles).all():
        raise DescriptorError(f"{link}: no triangles", path=file)
    return triangles * numbers(mesh, "scale", 3, "1 1 1")


def _stl_triangles(data: bytes) -> FloatArray:
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
