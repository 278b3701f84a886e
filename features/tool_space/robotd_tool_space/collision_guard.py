"""Keeps the arms of a robot from collisions, where its file asks for it. No safety function."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain

import numpy as np

from robotd.api import NANOSECONDS, FloatArray, ProcessImage, get_logger
from robotd.api.robots import (
    Outcome,
    Robot,
    Solid,
    Trajectory,
    TrajectoryRejected,
    reject,
)
from robotd_tool_space.collision.between_arms import BetweenArms
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.collision.scene import Scene
from robotd_tool_space.collision.scene_object import SceneObject, file_objects
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.settings import ToolSpaceKeys
from robotd_tool_space.tool_groups import ToolGroups

log = get_logger("tool")

SILENT_NS = NANOSECONDS  # without an obstacle, after which the next one is recorded
REACTION_PERIODS = 3  # until the device has begun to stop
LOOK_HZ = 100.0  # between two arms: a look takes longer than all else in a period at rest


class CollisionGuard:
    """Checks of all motion of the arms of a robot; none where the key ``collisions`` is null.

    Made with each robot whose file has the key. Trajectories are checked whole and rejected,
    streams, moves and jogs are stopped in time. The scene of an arm may change meanwhile. Two arms
    on one base are kept apart: a trajectory is rejected for an arm at rest, and stopped for one
    that moves.

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

        apart = [
            _ArmsApart(robot, first, second)
            for first, second in itertools.combinations(guards.values(), 2)
            if first.base == second.base
        ]

        def look(image: ProcessImage) -> None:
            for guard in guards.values():
                guard.look(image)

        def look_between(image: ProcessImage) -> None:
            for arms in apart:
                arms.look(image)

        every = robot.control_loop.every
        every(robot.descriptor.cycle.rate_hz, "collisions", look)
        if apart:
            every(LOOK_HZ, "arms apart", look_between)

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
        self._columns = list(tool.group.joint_axes)
        self.base, self.apart = tool.base, list[_ArmsApart]()
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
        self.collisions = self.with_tool(tool)
        for arms in self.apart:
            arms.renew()
        self._check_anew()

    def _check_anew(self) -> None:
        """Let a path that has passed be checked again: the follower remembers it, and by what."""
        self._tool.group.motion_limits.check_path = partial(self._check_path, self.collisions)

    def _check_path(self, collisions: Collisions, trajectory: Trajectory) -> None:
        """Check a path before it begins. Raises TrajectoryRejected."""
        collisions.check_path(trajectory)
        for arms in self.apart:
            arms.check_path(self, trajectory)
            self._check_anew()  # the other arm may move before the path comes again

    def _use_scene(self, objects: Sequence[SceneObject], name: str) -> str:
        """Take objects into account from now on; see ``scene.Use``. Any worker thread."""
        changed = {tool: known.with_objects(objects) for tool, known in self._of_file.items()}
        here = self._image.copy().position[self._columns]
        for collisions in changed.values():
            collisions.distances(np.zeros((1, len(here))))  # computes once what it keeps
        motion = self._tool.group.motion
        with motion.lock:  # no path is begun that was checked with those before
            self._by_tool = changed
            self._use(self._tool.tool_name)
            stopped = motion.end_trajectories(Outcome.STOPPED, self._meets)
        said = [f"motion is stopped: {stopped}"] if stopped else []
        if name and np.isfinite(here).all() and (close := self.collisions.too_close(here, name)):
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
            self.collisions.check_path(trajectory, time_s)
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
        """Return as ``Collisions.obstacle``, also for other arms. Control loop."""
        reason = self.collisions.obstacle(positions, stopped)
        for arms in self.apart:
            reason = reason or arms.obstacle(self, positions, stopped)
        if reason:
            self.tell(reason)
        return reason

    def motion(self, image: ProcessImage) -> tuple[FloatArray, FloatArray]:
        """Return the positions (n,) asked for now, and those at the end of a stop from now on.

        Equal at rest. What the device is not known to ask for is what it measures.
        """
        position, velocity = image.commands[:, self._columns]
        measured = image.measured[:2, self._columns]
        position = np.where(np.isfinite(position), position, measured[0])
        velocity = np.where(np.isfinite(velocity), velocity, measured[1])
        # A path is followed until all joints are at rest together.
        ramps = np.minimum(self._ramps(), self._acceleration)
        seconds = self._reaction_s + 1.0 / LOOK_HZ + 0.5 * float(np.max(np.abs(velocity) / ramps))
        return position, position + velocity * seconds

    def stop(self, reason: str, image: ProcessImage) -> None:
        """Stop trajectories and what the device moves; streams ask ``obstacle``. Control loop."""
        self._tool.group.motion.end_trajectories(Outcome.STOPPED, lambda *_: reason)
        if moved := self._tool.group.moved_by_device(image):
            self._axes.stops.request(moved)

    def tell(self, reason: str) -> None:
        """Log why motion is stopped, once while a client goes on."""
        before_ns, self._met_ns = self._met_ns, self._clock.now_ns()
        if self._met_ns - before_ns > SILENT_NS:
            log.warning("motion stopped before a collision", reason=reason)

    def _ramps(self) -> FloatArray:
        return np.array([self._axes.braking.deceleration[axis] for axis in self._columns])

    def look(self, image: ProcessImage) -> None:
        """Stop moves and jogs that run in the device, and would collide otherwise."""
        moved = self._tool.group.moved_by_device(image)
        if not moved:
            return
        position, velocity = image.measured[:2, self._columns]
        ramps = np.minimum(self._ramps(), self._acceleration)
        seconds = self._reaction_s + 0.5 * np.abs(velocity) / ramps
        if self.obstacle(position, position + velocity * seconds):
            self._axes.stops.request(moved)


class _ArmsApart:
    """Keeps two arms on one base from each other. Control loop, where nothing else is said."""

    def __init__(self, robot: Robot, first: _GroupGuard, second: _GroupGuard) -> None:
        self._image, self._arms = robot.image, (first, second)
        self.renew()
        for arm in self._arms:
            arm.apart.append(self)

    def renew(self) -> None:
        """Take another tool or scene of an arm into account. Any thread."""
        first, second = (arm.collisions for arm in self._arms)
        between = BetweenArms(first, second)
        between.distances(np.zeros((1, len(between.joints))))  # computes once what it keeps
        self._between = between

    def check_path(self, arm: _GroupGuard, trajectory: Trajectory) -> None:
        """Check a path of one arm while the other rests. Any thread.

        Where that moves is not known before: ``look`` stops both in time.

        Raises TrajectoryRejected: the arms come too close, or a position is not known.
        """
        position, stopped = self._other(arm).motion(self._image.copy())
        if not np.isfinite(position).all():
            raise reject("the positions of the other arm are not known")
        if (position != stopped).any():
            return

        def with_other(positions: FloatArray) -> FloatArray:
            others = np.broadcast_to(position, (len(positions), len(position)))
            return np.concatenate(self._in_order(arm, positions, others), axis=1)

        self._between.check_path(trajectory, completed=with_other)

    def obstacle(self, arm: _GroupGuard, positions: FloatArray, stopped: FloatArray) -> str:
        """Return what two arms that stop as soon as they can meet on their way; "": nothing."""
        others = self._other(arm).motion(self._image)
        ways = zip((positions, stopped), others, strict=True)
        return self._between.obstacle(*(np.concatenate(self._in_order(arm, *way)) for way in ways))

    def look(self, image: ProcessImage) -> None:
        """Stop motion that would bring the arms together."""
        motions = [arm.motion(image) for arm in self._arms]
        moving = [
            arm
            for arm, (position, stopped) in zip(self._arms, motions, strict=True)
            if (position != stopped).any()
        ]
        if not moving:
            return
        reason = self._between.obstacle(*map(np.concatenate, zip(*motions, strict=True)))
        if reason:
            moving[0].tell(reason)
            for arm in moving:
                arm.stop(reason, image)

    def _other(self, arm: _GroupGuard) -> _GroupGuard:
        first, second = self._arms
        return second if arm is first else first

    def _in_order(
        self, arm: _GroupGuard, own: FloatArray, others: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        return (own, others) if arm is self._arms[0] else (others, own)
