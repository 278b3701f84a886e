"""Paths of a robot by name: recorded while its joints are moved, and played."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from robotd.api import FloatArray, InvalidArgument, NotReady, RobotdError, unknown_name
from robotd.api.robots import JointGroup, JointLimits, Robot
from robotd_shared.pose_file import check_name
from robotd_teach.joint_groups import (
    beyond_limits,
    commands_at_rest,
    follow,
    group_of,
    joint_group,
)
from robotd_teach.path_curve import PathCurve, thinned, tolerances
from robotd_teach.path_file import (
    SUFFIX,
    PathFile,
    folder_of,
    paths_in,
    read_path,
    require_free,
    write_path,
)
from robotd_teach.path_motion import (
    PathMotion,
    PathTiming,
    approach_text,
    curve_of,
    plan_path,
    require_at_start,
)
from robotd_teach.path_recorder import PathRecorder, PathRecording, RecordingState

SLOWEST = 0.01
SPEEDS = {PathTiming.RECORDED: 1.0, PathTiming.LIMITS: 0.2}


@dataclass(frozen=True)
class Playback:
    """Options of a playback.

    Attributes:
        speed: 0.01 to 1, a part of what ``timing`` names; None: 1 of the recorded speed, or 0.2 of
            the limits.
        timing: what it is a part of.
        reverse: from its end to its start.
        begin: part of its time that is left out first, 0 to less than 1.

    Raises InvalidArgument: a value is out of its range.
    """

    speed: float | None = None
    timing: PathTiming = PathTiming.RECORDED
    reverse: bool = False
    begin: float = 0.0

    def __post_init__(self) -> None:
        if self.speed is not None and not SLOWEST <= self.speed <= 1.0:
            raise InvalidArgument(f"speed is {self.speed:g}, must be {SLOWEST:g} to 1")
        if not 0.0 <= self.begin < 1.0:
            raise InvalidArgument(f"begin is {self.begin:g}, must be 0 to less than 1")

    def curve(self, path: PathFile, limits: JointLimits) -> PathCurve:
        """Return the curve that is played. Raises InvalidArgument: nothing moves on it."""
        positions = path.positions(limits.names)
        return curve_of(path.times_s, positions, limits, reverse=self.reverse, begin=self.begin)

    def plan(self, curve: PathCurve, limits: JointLimits, start: FloatArray) -> PathMotion:
        """Return the motion to a curve and along it; see ``plan_path``."""
        speed = SPEEDS[self.timing] if self.speed is None else self.speed
        return plan_path(curve, limits, start, speed, self.timing)


class PathPlan(NamedTuple):
    """Planned playback: the joints, their motion, and a sentence about it."""

    group: JointGroup
    motion: PathMotion
    text: str


class PathState(NamedTuple):
    """State of a path; ``problem``: why it cannot be played, "" where nothing is known."""

    joints: list[str]
    duration_s: float
    points: int
    problem: str


class Paths:
    """Paths of a robot: ``robot.feature(Paths)``. Any worker thread.

    A path has the positions of the joints of one group over time. Its file is read for each
    question, so that what a person edits counts at once.

    Attributes:
        folder: of the files.
        on_change: called after each change of them, in the thread that made it.
    """

    def __init__(self, robot: Robot) -> None:
        self.folder = folder_of(robot.descriptor)
        self.on_change: Callable[[], None] = lambda: None
        self._robot, self._recorder = robot, PathRecorder(robot)
        self._lock = threading.Lock()  # of the files and the recording

    def all(self) -> dict[str, PathState]:
        """Return the state of each path by name; a file that is wrong is a problem of its path."""
        return {name: self._state(file) for name, file in paths_in(self.folder).items()}

    def known(self, name: str) -> PathFile:
        """Return a path. Raises InvalidArgument: unknown; DescriptorError: its file is wrong."""
        return read_path(self._file(name))

    def read(self, names: Collection[str]) -> dict[str, PathFile]:
        """Return those of the paths that exist. Raises DescriptorError: a file is wrong."""
        files = paths_in(self.folder)
        return {name: read_path(files[name]) for name in sorted(names) if name in files}

    def problem(self, path: PathFile) -> str:
        """Return why a path cannot be played; "": nothing is known against it."""
        if path.robot != (own := self._robot.descriptor.name):
            return f"it was recorded on the robot {path.robot}, this one is {own}"
        try:
            group = group_of(self._robot, path.joints)
        except InvalidArgument as error:
            return str(error)
        return beyond_limits(group.follower.limits, path.positions(group.joint_names))

    def begin(self, name: str, group: str = "", *, replace: bool = False) -> str:
        """Begin to record the joints of a group, whatever moves them, and return a text.

        Args:
            name: of the path.
            group: joint group; "": the only one.
            replace: a path of this name is replaced.

        Raises:
            InvalidArgument: no name, the name is taken, or no such group.
            NotReady: another recording is under way, or the positions are not known.
        """
        check_name(name, "path")
        joints = joint_group(self._robot, group)
        self._robot.connection.require_ready()
        with self._lock:
            if (current := self._recorder.current) is not None:
                told = f"{current.name} is being recorded, {current.state.duration_s:.0f} s of it"
                raise NotReady(f"{told}: end that first (robotd path end)")
            require_free(self.folder, name, replace=replace)
            self._recorder.current = PathRecording(name, joints, replace=replace)
        return f"{', '.join(joints.joint_names)} are recorded"

    def recording_state(self) -> RecordingState:
        """Return the state of the recording under way. Raises NotReady: none is."""
        return self._recording().state

    def end(self) -> str:
        """End the recording, save its path, and return a text about it.

        Standing still at both ends is left out.

        Raises:
            NotReady: none is under way, or no position was known.
            InvalidArgument: the joints have not moved; nothing is saved.
            OSError: the file cannot be written; it can be tried again.
        """
        with self._lock:
            recording = self._recording()
            limits = recording.group.follower.limits
            try:
                path, told = kept_path(self._robot.descriptor.name, limits, *recording.recorded())
            except RobotdError:
                self._recorder.current = None
                raise
            require_free(self.folder, recording.name, replace=recording.replace)
            write_path(self.folder / f"{recording.name}{SUFFIX}", path)
            self._recorder.current = None
        self.on_change()
        told = f"{recording.name}: {told}"
        if recording.reason:
            told += f"; the recording ended early: {recording.reason}"
        return told

    @contextmanager
    def recording(self, name: str, group: str = "", *, replace: bool = False) -> Iterator[None]:
        """Record in the block, and save the path after it; see ``begin`` and ``end``."""
        self.begin(name, group, replace=replace)
        try:
            yield
        finally:
            self.end()

    def rename(self, name: str, new: str) -> None:
        """Give a path another name. Raises InvalidArgument: unknown, taken, or no name."""
        check_name(new, "path")
        with self._lock:
            file = self._file(name)
            require_free(self.folder, new)
            file.rename(file.with_name(f"{new}{SUFFIX}"))
        self.on_change()

    def delete(self, name: str) -> None:
        """Delete a path. Raises InvalidArgument: unknown."""
        with self._lock:
            self._file(name).unlink()
        self.on_change()

    def plan(
        self, name: str, playback: Playback = Playback(), *, approach: bool = False
    ) -> PathPlan:
        """Return the motion along a path from where the arm rests. Nothing moves.

        Args:
            name: of the path.
            playback: how it is played.
            approach: the joints go to where it begins first, at a fifth of their limits; otherwise
                they have to be there.

        Raises:
            InvalidArgument: unknown, cannot be played, or away from where it begins.
            NotReady: the joints move, or it is not known where they are.
            DescriptorError: its file is wrong.
        """
        path = self.known(name)
        if problem := self.problem(path):
            raise InvalidArgument(f"{name} cannot be played: {problem}")
        group = group_of(self._robot, path.joints)
        limits = group.follower.limits
        start, curve = commands_at_rest(self._robot, group), playback.curve(path, limits)
        if not approach:
            require_at_start(limits, start, curve.positions[0])
        motion, told = (
            playback.plan(curve, limits, start),
            approach_text(limits, start, curve.positions[0]),
        )
        seconds = motion.motion.duration_s - motion.approach_s
        text = f"{name}: {seconds:.1f} s{', backwards' if playback.reverse else ''}"
        text += f", at most {_largest(limits, motion.deviation)} off the path"
        return PathPlan(group, motion, f"{text}; first to its start: {told}" if told else text)

    def play(self, name: str, playback: Playback = Playback(), *, approach: bool = False) -> None:
        """Move along a path, and return at rest at its end. Arguments: see ``plan``.

        Raises:
            InvalidArgument, NotReady, DescriptorError: see ``plan``; nothing has moved.
            TrajectoryRejected: the joints cannot be commanded; nothing has moved.
            OperationError: the motion ended early, with the reason.
        """
        group, motion, _ = self.plan(name, playback, approach=approach)
        request = motion.motion.request(group.joint_names)
        follow(self._robot, group, request, f"along {name}")

    def _recording(self) -> PathRecording:
        if (recording := self._recorder.current) is None:
            raise NotReady("no path is being recorded")
        return recording

    def _file(self, name: str) -> Path:
        """Return the file of a path. Raises InvalidArgument: there is none."""
        files = paths_in(self.folder)
        if name not in files:
            raise InvalidArgument(unknown_name("path", name, files))
        return files[name]

    def _state(self, file: Path) -> PathState:
        try:
            path = read_path(file)
        except (RobotdError, OSError) as error:
            return PathState([], 0.0, 0, str(error))
        return PathState(path.joints, path.duration_s, len(path.points), self.problem(path))


def kept_path(
    robot: str, limits: JointLimits, times_s: FloatArray, positions: FloatArray
) -> tuple[PathFile, str]:
    """Return the path of what was recorded of the joints of ``limits``, and a text about it.

    Args:
        robot: name of it.
        limits: of the joints.
        times_s: (k,) increasing.
        positions: (k, n), rad or m.

    Raises InvalidArgument: the joints did not move, or the path needs too many points.
    """
    kept_s, kept, deviation = thinned(times_s, positions, tolerances(limits.units))
    path = PathFile.of(robot, limits.names, kept_s, kept)
    told = f"at most {_largest(limits, deviation)} from what was recorded"
    return path, f"{kept_s[-1]:.1f} s, {len(kept)} points, {told}"


def _largest(limits: JointLimits, distances: FloatArray) -> str:
    """Return the largest distance of a joint, by its tolerance."""
    joint = int((distances / tolerances(limits.units)).argmax())
    return f"{distances[joint]:.4f} {limits.units[joint]} ({limits.names[joint]})"
