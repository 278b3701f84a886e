"""Services and topic of the paths on the node ``robotd``.

A recording goes on without its client, until ``~/paths/end`` saves it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer
from robotd_msgs.msg import SavedPath, SavedPaths
from robotd_msgs.srv import BeginPath, DeletePath, KeepPath, PlanPath, RenamePath
from std_srvs.srv import Trigger

from robotd.api import InvalidArgument
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_ros.trajectory_messages import trajectory_of
from robotd_teach.path_file import changes_in
from robotd_teach.path_motion import PathTiming
from robotd_teach.paths import Paths, Playback

PATHS = "~/paths"
LOOK_PERIOD_S = 0.5
TIMINGS = {
    PlanPath.Request.RECORDED: PathTiming.RECORDED,
    PlanPath.Request.LIMITS: PathTiming.LIMITS,
}


@contextmanager
def add_path_services(context: NodeContext, paths: Paths) -> Iterator[None]:
    """Add services and topic."""
    node, host = context.operator, context.host
    topic = node.create_publisher(SavedPaths, PATHS, LATCHED)

    def publish() -> None:
        saved = [SavedPath(name=name, **state._asdict()) for name, state in paths.all().items()]
        publish_if_alive(topic, SavedPaths(paths=saved))

    def begin(request: Any, response: Any) -> str:
        return paths.begin(request.name, request.group, replace=request.replace)

    def keep(request: Any, response: Any) -> str:
        state = paths.recording_state()
        response.name, response.duration_s = state.name, state.duration_s
        response.joints, response.positions = [*state.joints], [*state.joints.values()]
        response.reason = state.reason
        return ""

    def end(request: Any, response: Any) -> str:
        return paths.end()

    def plan(request: Any, response: Any) -> str:
        plan = paths.plan(request.name, _playback(request), approach=request.approach)
        motion = plan.motion.motion
        response.trajectory = trajectory_of(
            plan.group.joint_names,
            motion.times_s.tolist(),
            motion.positions.tolist(),
            motion.velocities.tolist(),
        )
        response.parts = plan.motion.parts.tolist()
        return plan.text

    def rename(request: Any, response: Any) -> str:
        paths.rename(request.name, request.new_name)
        return f"{request.name} is called {request.new_name} now"

    def delete(request: Any, response: Any) -> str:
        paths.delete(request.name)
        return f"{request.name} is deleted"

    for service_type, name, handle in (
        (BeginPath, "begin", begin),
        (Trigger, "end", end),
        (PlanPath, "plan", plan),
        (RenamePath, "rename", rename),
        (DeletePath, "delete", delete),
    ):
        add_service(node, host, service_type, f"{PATHS}/{name}", handle)
    add_service(node, host, KeepPath, f"{PATHS}/keep", keep, blocking=False)
    paths.on_change = publish
    publish()
    timer = _watch(node, paths.folder, publish)
    yield
    timer.cancel()


def _watch(node: Node, folder: Path, publish: Callable[[], None]) -> Timer:
    """Publish when a person, or a command without a robot, has changed the files."""
    shown = changes_in(folder)

    def look() -> None:
        nonlocal shown
        if (found := changes_in(folder)) != shown:
            shown = found
            publish()

    # Wall time that no clock jump and no simulated clock can stop.
    return node.create_timer(LOOK_PERIOD_S, look, clock=Clock(clock_type=ClockType.STEADY_TIME))


def _playback(request: Any) -> Playback:
    """Return how a path is played. Raises InvalidArgument."""
    if (timing := TIMINGS.get(request.timing)) is None:
        raise InvalidArgument(f"timing is {request.timing}, must be 0 (RECORDED) or 1 (LIMITS)")
    return Playback(request.speed or None, timing, request.reverse, request.begin)
