"""Check of a whole program against a robot, before anything moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from robotd.api import DescriptorError, FloatArray, InvalidArgument, RobotdError, unknown_name
from robotd.api.robots import Gripper, Robot, ServoGripper
from robotd_teach.io_names import bit_of
from robotd_teach.program_code import Again, Begin, Branch, Do, Jump, Keys, Program
from robotd_teach.program_file import SetGripper, Step
from robotd_teach.program_motion import Place, StepPlanner
from robotd_tool_space.collision_guard import CollisionGuard

MAX_MOTIONS = 5000  # checked ones: a step counts for each place from which it is begun
MAX_PLACES = 64  # at which the arm may be before one step
MAX_PROBLEMS = 50
SAME = 6  # decimals of positions that are one place, rad or m
NONE = "none"  # name with which the link itself, or the base, is chosen

AnyGripper = Gripper | ServoGripper
Places = Sequence[Place]


class ProgramCheck:
    """Follows a program from where the arm is, through both sides of each ``if``.

    Names, limits, reach, singular places, and collisions where the robot's guard checks them. Any
    worker thread.

    Args:
        robot: that is to execute it.
        program: to be checked.
        planner: of its motion.
        wait: called between two motions; it may raise.
    """

    def __init__(
        self,
        robot: Robot,
        program: Program,
        planner: StepPlanner,
        wait: Callable[[], None] = lambda: None,
    ) -> None:
        self._robot, self._program, self._planner, self._wait = robot, program, planner, wait
        self._guard = robot.feature(CollisionGuard)
        self._ends: dict[tuple[int, object], Place] = {}
        self._problems: dict[str, DescriptorError] = {}

    def run(self, start: Place) -> None:
        """Check it from ``start``. Raises DescriptorError with what is wrong, by line and key."""
        self._check_poses()
        for instruction in self._program.instructions:
            if isinstance(instruction, Do):
                self._check_names(instruction)
            elif isinstance(instruction, Branch):
                keys = (*instruction.keys, "input")
                self._try(keys, partial(self._input, instruction.condition.input))
        if not self._problems:  # a motion from a place that is not known says nothing
            self._walk(0, len(self._program.instructions), [start])
        if self._problems:
            raise DescriptorError.join(self._problems.values())

    def _walk(self, first: int, last: int, places: Places) -> Places:
        """Follow the instructions from ``first`` to before ``last``; return where they lead."""
        code, index = self._program.instructions, first
        while index < last and places and not self._is_full:
            match code[index]:
                case Do() as do:
                    places = _distinct([self._step(index, do, place) for place in places])
                    index += 1
                case Begin(times, end):
                    places = self._repeat(index + 1, end, times, places)
                    index = end + 1
                case Branch(_, otherwise, keys):
                    # ``Jump`` before the other side leads beyond it.
                    jump = code[otherwise - 1]
                    end = jump.target if isinstance(jump, Jump) else otherwise
                    sides = (
                        *self._walk(index + 1, otherwise - 1, places),
                        *self._walk(otherwise, end, places),
                    )
                    places = _distinct(sides)
                    if len(places) > MAX_PLACES:
                        text = f"the arm may be at more than {MAX_PLACES} places after it"
                        self._add(keys, f"{text}: move it to one pose on both sides")
                        return []
                    index = end
                case Again() | Jump():
                    index += 1
        return places

    def _repeat(self, first: int, end: int, times: int | None, places: Places) -> Places:
        """Follow repeated steps until they lead to the places of the time before."""
        seen: dict[frozenset[object], int] = {}
        done = 0
        while (times is None or done < times) and not self._is_full:
            places, done = self._walk(first, end, places), done + 1
            key = frozenset(_key(place) for place in places)
            if key in seen:  # from here on as since then
                if times is None:
                    return []  # nothing comes after an endless loop
                period = done - seen[key]
                done += (times - done) // period * period
                seen = {}
            seen[key] = done
        return places

    def _step(self, index: int, do: Do, place: Place) -> Place:
        """Return where a step leads; its problem is recorded."""
        step, key = do.step, (index, _key(place))
        if key in self._ends:
            return self._ends[key]
        if step.tool is not None:
            end = Place(place.positions, chosen(step.tool), place.work_frame)
        elif step.work_frame is not None:
            end = Place(place.positions, place.tool, chosen(step.work_frame))
        elif is_motion(step):
            end = self._motion(do, place)
        else:
            return place
        self._ends[key] = end
        if len(self._ends) > MAX_MOTIONS:
            text = f"repeated steps lead to ever new places: at most {MAX_MOTIONS} are checked"
            self._add(do.keys, text)
        return end

    def _motion(self, do: Do, place: Place) -> Place:
        self._wait()
        try:
            positions = self._planner.trace(do.step, place)
            self._guard.check_positions(self._planner.group.name, place.tool, positions)
        except RobotdError as error:
            self._add(do.keys, str(error))
            return place
        return Place(positions[-1], place.tool, place.work_frame)

    def _check_poses(self) -> None:
        for name, joints in self._program.file.poses.items():
            for joint, position in joints.items():
                if not math.isfinite(position):
                    self._add(("poses", name, joint), f"{position} is not finite")
            check = partial(self._planner.checked_pose, f"pose {name}", joints)
            self._try(("poses", name), check)

    def _check_names(self, do: Do) -> None:
        """Check what a step names, wherever the arm is."""
        step, keys = do.step, do.keys
        self._try((*keys, "until"), partial(self._planner.contact, step, Place(None)))
        if step.needs_tool:
            self._try(keys, self._planner.need_tool)
        if step.tool is not None:
            name = step.tool
            self._try(keys, lambda: self._planner.need_tool().kinematics_of(chosen(name)))
        if step.work_frame is not None:
            frame = step.work_frame
            self._try(keys, lambda: self._planner.need_tool().work_frame_of(chosen(frame)))
        if step.payload is not None:
            self._try(keys, partial(self._robot.payload.check, step.payload.payload))
        if step.gripper is not None:
            self._try(keys, partial(self._check_grip, step.gripper))
        for number, segment in enumerate(step.sequence.segments if step.sequence else ()):
            for place, output in enumerate(segment.outputs):
                where = (*keys, "segments", number, "outputs", place, "name")
                self._try(where, partial(self._output, output.name))
        if step.output is not None:
            self._try((*keys, "name"), partial(self._output, step.output.name))
        if step.wait is not None and step.wait.input is not None:
            self._try((*keys, "input"), partial(self._input, step.wait.input))

    def _check_grip(self, grip: SetGripper) -> None:
        gripper = gripper_of(self._robot, grip.name)
        grip_position(gripper, grip)
        group = self._planner.group
        if isinstance(gripper, ServoGripper) and gripper.joints[0] in group.joint_names:
            text = f"{gripper.joints[0]} is one of the joints that the program moves: use `move`"
            raise InvalidArgument(text)

    def _input(self, name: str) -> None:
        io = self._robot.io
        bit_of("input", name, io.inputs, io.sizes[0])

    def _output(self, name: str) -> None:
        io = self._robot.io
        bit_of("output", name, io.outputs, io.sizes[1])

    def _try(self, keys: Keys, check: Callable[[], object]) -> None:
        try:
            check()
        except RobotdError as error:
            self._add(keys, str(error))

    def _add(self, keys: Keys, text: str) -> None:
        error = self._program.problem(keys, text)
        self._problems.setdefault(str(error), error)

    @property
    def _is_full(self) -> bool:
        return len(self._problems) >= MAX_PROBLEMS or len(self._ends) > MAX_MOTIONS


def is_motion(step: Step) -> bool:
    """Return whether a step moves the joints."""
    return step.kind in ("move", "line", "arc", "path", "sequence")


def gripper_of(robot: Robot, name: str) -> AnyGripper:
    """Return a gripper by its name; "": the one on an output, or the only one.

    Raises InvalidArgument: unknown, or not clear.
    """
    grippers = robot.grippers
    if not grippers:
        raise InvalidArgument(f"{robot.descriptor.name} has no gripper")
    if name in grippers:
        return grippers[name]
    if name:
        raise InvalidArgument(unknown_name("gripper", name, filter(None, grippers)))
    if len(grippers) > 1:
        raise InvalidArgument(f"which gripper? Name one of {', '.join(grippers)}")
    return next(iter(grippers.values()))


def grip_position(gripper: AnyGripper, grip: SetGripper) -> float:
    """Return the position that a step commands. Raises InvalidArgument: beyond an end."""
    ends = {"open": gripper.open_m, "close": gripper.closed_m}
    return ends[grip.to] if isinstance(grip.to, str) else gripper.checked(grip.to)


def chosen(name: str) -> str:
    """Return the name of a tool or a work frame, "" for none."""
    return "" if name == NONE else name


def _key(place: Place) -> object:
    rounded = None if place.positions is None else _rounded(place.positions)
    return rounded, place.tool, place.work_frame


def _rounded(positions: FloatArray) -> bytes:
    return (np.round(positions, SAME) + 0.0).tobytes()


def _distinct(places: Places) -> Places:
    return list({_key(place): place for place in places}.values())
