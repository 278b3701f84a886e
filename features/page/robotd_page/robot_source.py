"""Source of the page of the robot in this process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from robotd.api import InvalidArgument
from robotd.api.features import CameraPictures, Tap
from robotd_page.page_feed import PageFeed
from robotd_shared.mesh_files import MeshFiles


class RobotSource:
    """The one robot of this process, whatever name the page asks for.

    Args:
        tap: of the robot.
        nodes: names of the ROS nodes that are served.
        has_control: the page can be unlocked to control the robot.
        namespace: of the ROS nodes.
    """

    def __init__(
        self,
        tap: Tap,
        nodes: Sequence[str],
        *,
        has_control: bool = False,
        namespace: str = "/",
    ) -> None:
        self._meshes = MeshFiles()
        urls = self._meshes.add(tap.urdf, tap.robot.descriptor.urdf)
        self._feed = PageFeed(
            tap, nodes, urls, has_control=has_control, namespace=namespace, has_pictures=True
        )
        world = tap.robot.world
        self._pictures = CameraPictures(world) if world is not None else None
        self._loop = tap.robot.control_loop

    def feed(self, robot: str) -> PageFeed:
        return self._feed

    def file(self, url: str) -> Path | None:
        return self._meshes.file(url)

    def picture(self, camera: str) -> bytes:
        if self._pictures is None:
            raise InvalidArgument("the robot has no cameras")
        return self._pictures.newest(camera)

    @property
    def yield_to_control_loop(self) -> Callable[[], None]:
        return self._loop.yield_to_control_loop
