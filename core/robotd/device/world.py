"""Surroundings of a simulated robot: objects that can be seen, moved and put back."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from robotd.arrays import FloatArray
from robotd.errors import Unsupported

POSE_VALUES = ("x", "y", "z", "qx", "qy", "qz", "qw")


class Shape(StrEnum):
    """Shape of an object.

    The origin of a pose is its middle, the axis of a cylinder is z.
    """

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    MESH = "mesh"


@dataclass(frozen=True)
class WorldObject:
    """One object.

    Attributes:
        name: a frame of TF.
        shape: what ``size_m`` means.
        size_m: edges of a box; radius and length of a cylinder; radius of a sphere; factors by
            which a mesh is scaled.
        color: red, green, blue and opacity, 0 to 1.
        moves: False: it is fixed, like a table.
        mesh: file of a mesh; None for other shapes.
    """

    name: str
    shape: Shape
    size_m: tuple[float, ...]
    color: tuple[float, float, float, float]
    moves: bool
    mesh: Path | None = None


@dataclass(frozen=True)
class WorldCamera:
    """Camera of a world, without distortion.

    Attributes:
        name: of its topics and its optical frame (z forward, x right, y down).
        width, height: pixels.
        focal_px: focal length; the principal point is the middle of the image.
        rate_hz: of its images.
    """

    name: str
    width: int
    height: int
    focal_px: float
    rate_hz: float


class World(ABC):
    """Surroundings of a robot on a backend that is ``SIMULATED``.

    Any thread may call, unless a method says otherwise. Poses are x, y, z in m and a quaternion
    x, y, z, w, in ``frame``.
    """

    @property
    @abstractmethod
    def frame(self) -> str:
        """Name of the frame of all poses. Read once."""

    @property
    @abstractmethod
    def objects(self) -> Sequence[WorldObject]:
        """Objects, in the order of ``poses``. Read once."""

    @abstractmethod
    def poses(self) -> FloatArray:
        """Return the present poses (n_objects, 7), a copy. Called in the control loop, too."""

    @abstractmethod
    def reset(self) -> None:
        """Put all objects back to their first poses, at rest. The robot stays."""

    @abstractmethod
    def place(self, name: str, pose: FloatArray) -> None:
        """Put an object to ``pose`` (7,), at rest.

        Raises InvalidArgument: there is no such object, or it is fixed.
        """

    @property
    def cameras(self) -> Sequence[WorldCamera]:
        """Cameras; empty without one. Read once."""
        return ()

    def image(self, camera: str) -> NDArray[Any]:
        """Return the present picture of ``camera``, uint8 of shape (height, width, 3), RGB.

        Takes milliseconds. Raises InvalidArgument for an unknown camera,
        OperationError where pictures cannot be made, with what is missing.
        """
        raise Unsupported("cameras")
