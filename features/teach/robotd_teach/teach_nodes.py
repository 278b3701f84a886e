"""Services, topics and the action of teaching on the node ``robotd``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robotd.api import Capability
from robotd_ros.run_nodes import NodeContext
from robotd_teach.guide_services import add_guide_services
from robotd_teach.hand_guiding import HandGuiding
from robotd_teach.path_services import add_path_services
from robotd_teach.paths import Paths
from robotd_teach.pose_services import add_pose_services
from robotd_teach.poses import Poses
from robotd_teach.program_services import ProgramAction, ProgramServices
from robotd_teach.programs import Programs


@contextmanager
def add_teach_nodes(context: NodeContext, poses: Poses) -> Iterator[None]:
    """Add what poses, paths, programs and hand guiding have."""
    if Capability.HAND_GUIDING in context.robot.capabilities:
        add_guide_services(context, context.robot.feature(HandGuiding))
    paths = context.robot.feature(Paths)
    with add_pose_services(context, poses), add_path_services(context, paths):
        programs = context.robot.feature(Programs)
        ProgramServices(context, programs)
        ProgramAction(context, programs)
        yield
