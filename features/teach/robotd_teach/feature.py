"""Teaching as a feature: a key of the robot's file, and services. Imports no ROS."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from robotd.api.features import Feature
from robotd_shared.teach_keys import TeachKeys

if TYPE_CHECKING:  # every command that reads a robot's file imports this module
    from robotd.api.features import FeatureHost
    from robotd.api.robots import Robot
    from robotd_teach.page_panel import TeachPanel

FEATURE = Feature(
    summary="poses and paths of a robot by name, programs of steps, hand guiding",
    settings=TeachKeys,
    open="robotd_teach.feature:open_teach",
    nodes="robotd_teach.teach_nodes:add_teach_nodes",
)


@contextmanager
def open_teach(host: FeatureHost) -> Iterator[object | None]:
    """Return the poses of a robot; None where it has no joints.

    What it offers as ``panel`` is the panel of the page.
    """
    if not host.robot.descriptor.joints:
        yield None
        return
    from robotd_teach.poses import Poses

    host.offered["panel"] = lambda: teach_panel(host.robot)
    yield host.robot.feature(Poses)


def teach_panel(robot: Robot) -> TeachPanel:
    """Return the panel of the page."""
    from robotd_teach.page_panel import TeachPanel

    return TeachPanel(robot)
