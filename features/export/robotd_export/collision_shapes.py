"""Collision shapes of a URDF as spheres that cover them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import DescriptorError, FloatArray
from robotd.api.models import xml_root
from robotd_shared.mesh_shapes import mesh_triangles, numbers, shape_pose

MAX_SLICES = 6  # of a shape, along its longest side


@dataclass(frozen=True)
class Cover:
    """Spheres that contain the collision shapes of a link.

    Attributes:
        centers: in the frame of the link, m; shape (n, 3).
        radii: m; shape (n,).
        is_known: False where a shape could not be read, so that the spheres do not contain it.
    """

    centers: FloatArray
    radii: FloatArray
    is_known: bool


def collision_covers(text: str, path: Path) -> dict[str, Cover]:
    """Return the cover of each link that has collision shapes.

    Boxes, cylinders, spheres and STL files are known; other meshes are not.

    Args:
        text: of a valid URDF.
        path: of its file, which relative names of meshes start from.
    """
    covers = {}
    for link in xml_root(text, path).iterfind("link"):
        found = [_spheres(each, path) for each in link.iterfind("collision")]
        known = [each for each in found if each is not None]
        if found:
            centers = np.concatenate([np.empty((0, 3)), *(centers for centers, _ in known)])
            radii = np.concatenate([np.empty(0), *(radii for _, radii in known)])
            covers[link.get("name", "")] = Cover(centers, radii, len(known) == len(found))
    return covers


def _spheres(collision: Any, path: Path) -> tuple[FloatArray, FloatArray] | None:
    """Return centres and radii in the frame of the link; None for an unknown shape."""
    found = _own_spheres(collision.find("geometry"), path)
    if found is None:
        return None
    centers, radii = found
    pose = shape_pose(collision)
    return centers @ pose[:3, :3].T + pose[:3, 3], radii


def _own_spheres(geometry: Any, path: Path) -> tuple[FloatArray, FloatArray] | None:
    for shape in geometry if geometry is not None else ():
        match shape.tag:
            case "sphere":
                return np.zeros((1, 3)), numbers(shape, "radius")
            case "cylinder":
                radius, length = (float(numbers(shape, key)[0]) for key in ("radius", "length"))
                return _slices(np.array([2.0 * radius, 2.0 * radius, length]), 2, radius)
            case "box":
                size = numbers(shape, "size")
                axis = int(np.argmax(size))
                return _slices(size, axis, float(np.hypot(*np.delete(size, axis))) / 2.0)
            case "mesh":
                return _mesh_spheres(shape, path)
    return None


def _slices(size: FloatArray, axis: int, across: float) -> tuple[FloatArray, FloatArray]:
    """Cover a prism about ``axis``, centred at 0, whose edges have the distance ``across``."""
    count = int(np.clip(np.ceil(size[axis] / (2.0 * across or 1.0)), 1, MAX_SLICES))
    thickness = size[axis] / count
    centers = np.zeros((count, 3))
    centers[:, axis] = (np.arange(count) + 0.5) * thickness - size[axis] / 2.0
    return centers, np.full(count, np.hypot(across, thickness / 2.0))


def _mesh_spheres(mesh: Any, path: Path) -> tuple[FloatArray, FloatArray] | None:
    try:
        triangles = mesh_triangles(mesh, path)
    except DescriptorError:
        return None
    return _covering(triangles)


def _covering(triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cover triangles (n, 3, 3) by the spheres around slices of them.

    A sphere that holds the corners of a triangle holds the triangle.
    """
    middles = triangles.mean(axis=1)
    extent = np.ptp(triangles.reshape(-1, 3), axis=0)
    axis = int(np.argmax(extent))
    edges = np.quantile(middles[:, axis], np.linspace(0.0, 1.0, MAX_SLICES + 1)[1:-1])
    slice_of = np.searchsorted(edges, middles[:, axis])
    centers, radii = [], []
    for number in np.unique(slice_of):
        points = triangles[slice_of == number].reshape(-1, 3)
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0
        centers.append(center)
        radii.append(np.linalg.norm(points - center, axis=1).max())
    return np.array(centers), np.array(radii)
