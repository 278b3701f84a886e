"""Keeps the arms of a robot from collisions, where its file asks for it. No safety function."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, ProcessImage, get_logger
from robotd.api.robots import (
    Outcome,
    Robot,
    Solid,
    Trajectory,
    TrajectoryRejected,
)
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.collision.scene import Scene
from robotd_tool_space.collision.scene_object import SceneObject, file_objects
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

SILENT_NS = NANOSECONDS  # without an obstacle, after which the next one is recorded
REACTION_PERIODS = 3  # until the device has begun to stop


class CollisionGuard:
    """Checks of all motion of the arms of a robot; none where the key ``collisions`` is null.

    Made with each robot whose file has the key. Trajectories are checked whole and rejected,
    streams, moves and jogs are stopped in time. The scene of an arm may change meanwhile.

    Raises Unsupported, DescriptorError: a joint group has no usable chain, or the URDF no usable
    shapes.
    """

    def __init__(self, robot: Robot) -> None:
        settings = robot.descriptor.settings(ToolSpaceKeys).tool_space.collisions
        self._guards: dict[str, _GroupGuard] = {}
        if settings is None:
            return
        tools = robot.feature(ToolGroups)
        guards = self._guards
        for name, group in robot.groups.items():
            if group.joint_names:
                tool = tools.of(name)
                by_tool = {
                    chosen: Collisions.of(robot.descriptor, tool.at_link, settings, chosen)
                    for chosen in ("", *tool.tool_names)
                }
                guards[name] = _GroupGuard(robot, tool, by_tool, file_objects(settings))

        def look(image: ProcessImage) -> None:
            for guard in guards.values():
                guard.look(image)

        robot.control_loop.every(robot.descriptor.cycle.rate_hz, "collisions", look)

    def check_positions(self, group: str, tool: str, positions: FloatArray) -> None:
        """Check positions (k, n) of a joint group with a tool, as of a program. Any thread.

        Raises InvalidArgument: two bodies come too close; with both, and the place.
        """
        if group in self._guards:
            self._guards[group].with_tool(tool).check_positions(positions)


class _GroupGuard:
    """Guard of one joint group, with the body of the chosen tool. Control loop."""

    def __init__(
        self,
        robot: Robot,
        tool: RobotTool,
        by_tool: Mapping[str, Collisions],
        of_file: Sequence[SceneObject],
    ) -> None:
        self._axes, self._tool, self._image = robot.axes, tool, robot.image
        self._reaction_s = REACTION_PERIODS / robot.descriptor.cycle.rate_hz
        self._acceleration = tool.group.follower.limits.acceleration
        self._of_file, self._by_tool = by_tool, by_tool
        self._clock, self._met_ns = robot.clock, 0
        self._use(tool.tool_name)
        tool.on_tool = self._use
        tool.group.motion_limits.obstacle = self.obstacle
        names = {*chain.from_iterable(one.bodies.links for one in by_tool.values())}
        tool.scene = Scene(of_file, names, self._use_scene, self._rest)
        tool.scene.listeners.append(self._show)
        self._show()

    def _use(self, tool: str) -> None:
        """Check motion with the body of a tool from now on. Any thread."""
        self._collisions = self.with_tool(tool)
        self._tool.group.motion_limits.check_path = self._collisions.check_path

    def _use_scene(self, objects: Sequence[SceneObject], name: str) -> str:
        """Take objects into account from now on; see ``scene.Use``. Any worker thread."""
        changed = {tool: known.with_objects(objects) for tool, known in self._of_file.items()}
        here = self._image.copy().position[list(self._tool.group.joint_axes)]
        for collisions in changed.values():
            collisions.distances(np.zeros((1, len(here))))  # computes once what it keeps
        motion = self._tool.group.motion
        with motion.lock:  # no path is begun that was checked with those before
            self._by_tool = changed
            self._use(self._tool.tool_name)
            stopped = motion.end_trajectories(Outcome.STOPPED, self._meets)
        said = [f"motion is stopped: {stopped}"] if stopped else []
        if name and np.isfinite(here).all() and (close := self._collisions.too_close(here, name)):
            said.append(close)
        return "; ".join(said)

    def _show(self) -> None:
        tool, scene = self._tool, self._tool.scene
        if scene is not None:
            tool.group.motion_limits.solids = tuple(
                Solid(
                    item.name,
                    item.shape,
                    item.size_m,
                    item.pose,
                    tool.link if item.attached else tool.base,
                )
                for item in scene.objects
            )

    def _meets(self, trajectory: Trajectory, time_s: float) -> str:
        """Return what a trajectory in force runs into; streams look for that in each period."""
        try:
            self._collisions.check_path(trajectory, time_s)
        except TrajectoryRejected as error:
            return f"the scene has changed: {error}"
        return ""

    @contextmanager
    def _rest(self) -> Iterator[FloatArray]:
        with self._tool.group.motion.lock:
            yield self._tool.at_link.forward(self._tool.start())

    def with_tool(self, tool: str) -> Collisions:
        """Return the distances with the body of a tool; without one where it is not of the file."""
        return self._by_tool.get(tool, self._by_tool[""])

    def obstacle(self, positions: FloatArray, stopped: FloatArray) -> str:
        """Return as ``Collisions.obstacle``; the log has it once while a client goes on."""
        reason = self._collisions.obstacle(positions, stopped)
        if reason:
            before_ns, self._met_ns = self._met_ns, self._clock.now_ns()
            if self._met_ns - before_ns > SILENT_NS:
                log.warning("motion stopped before a collision", reason=reason)
        return reason

    def look(self, image: ProcessImage) -> None:
        """Stop moves and jogs that run in the device, and would collide otherwise."""
        moved = self._tool.group.moved_by_device(image)
        if not moved:
            return
        chosen = list(self._tool.group.joint_axes)
        position, velocity = image.position[chosen], image.velocity[chosen]
        ramps = np.array([self._axes.braking.deceleration[axis] for axis in chosen])
        seconds = self._reaction_s + 0.5 * np.abs(velocity) / np.minimum(ramps, self._acceleration)
        if self.obstacle(position, position + velocity * seconds):
            self._axes.stops.request(moved)
