"""Execution of a program: its steps, one after the other, with an end that can be resumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robotd.api import (
    CommandMode,
    FloatArray,
    NotReady,
    OperationError,
    RobotdError,
    wait_until,
)
from robotd.api.features import EventKind, Level
from robotd.api.robots import (
    Contact,
    ContactLimits,
    Interruption,
    Outcome,
    Robot,
    TrajectoryExecution,
    WrenchLimits,
)
from robotd_teach.io_names import bit_of
from robotd_teach.program_check import chosen, grip_position, gripper_of, is_motion
from robotd_teach.program_code import Again, Begin, Branch, Do, Jump, Program
from robotd_teach.program_file import SetGripper, Step, Wait_
from robotd_teach.program_motion import Distance, StepPlanner
from robotd_tool_space.paths.path_outputs import OutputSetter
from robotd_tool_space.paths.tool_motion import (
    ToolMotion,
    place_on,
    plan_fast_motion,
    positions_at,
)

POLL_S = 0.01
WAIT_S = 60.0  # of one wait in a loop without an end
MOVED = {"rad": 0.02, "m": 0.005}  # distance from where the arm was left that is too far
OFF_PATH = {"rad": 0.2, "m": 0.05}  # of its step, as after a fault, that is too far to go back
ON_PATH = 1e-4  # rad or m from it, below which the joints are on a path
RETURN_SPEED = 0.05  # of the joints' limits, back to a path
REACH_S = 1.0  # of a motion around where it ended, in which the arm may stand
SUBJECT = "program"  # of events


@dataclass(frozen=True, eq=False)
class Unfinished:
    """Motion of a step that ended early.

    Attributes:
        motion: whole.
        time_s: of it, where it ended.
    """

    motion: ToolMotion
    time_s: float


class NoContact(OperationError):
    """A motion with ``until`` has reached its target, and touched nothing."""


class FoundContact(NamedTuple):
    """Contact that has ended a step.

    Attributes:
        step: its number, from 1.
        contact: what was measured when it was noticed.
        stop: how far the arm went on, to rest.
    """

    step: int
    contact: Contact
    stop: Distance


class Loop(NamedTuple):
    """Repetition that has begun: index of its ``Begin``, and times that are over."""

    begin: int
    times: int


class ProgramRun:
    """One program and how far it is executed. ``go`` in one thread at a time; the rest any.

    Args:
        robot: that executes it.
        program: checked.
        planner: of its motion.
        on_change: called when a step begins or ends, in the thread of ``go``.

    Attributes:
        step: in execution, or to be executed next; None: before the first.
        executed: number of steps that were executed.
        message: last text for the operator.
        confirmed: False while a message waits for the operator.
        contact: that has ended the last step with ``until``; None: none has yet.
        done: all steps were executed.
        reason: why it has ended early; "" otherwise.
    """

    def __init__(
        self,
        robot: Robot,
        program: Program,
        planner: StepPlanner,
        on_change: Callable[[], None],
    ) -> None:
        self.program = program
        self.step: Do | None = None
        self.contact: FoundContact | None = None
        self.executed, self.message, self.reason = 0, "", ""
        self.confirmed, self.done = True, False
        self.part = 0.0  # of the motion of this step
        self._robot, self._planner, self._group = robot, planner, planner.group
        self._on_change = on_change
        self._on_tick: Callable[[], None] = lambda: None
        self._index = 0
        self._loops: list[Loop] = []
        self._unfinished: Unfinished | None = None
        self._left: FloatArray | None = None  # positions at which the last motion ended
        self._again_ns = 0
        self._began: list[Interruption] = []

    def go(self, on_tick: Callable[[], None], *, single: bool = False) -> None:
        """Execute the steps that are left, and return at rest.

        Args:
            on_tick: called all the time; what it raises ends the program.
            single: one step only.

        Raises:
            NotReady: the robot cannot move, or the arm was moved; nothing has moved.
            OperationError: the program ended early, with step and reason; NoContact: at the end of
                a motion that was to end at a contact.
        """
        if self.done:
            raise NotReady(f"{self.program.path} has been executed to its end: run it anew")
        self._require_ready()
        here = self._planner.here().positions
        if self._left is None:
            self._left = here
        self._require_unmoved()
        self.reason, self._on_tick = "", on_tick
        self._note("is resumed" if self.executed or self._unfinished else "begins")
        try:
            self._execute(single=single)
        except BaseException as error:
            self._stopped(error)
            if isinstance(error, RobotdError):
                kind = NoContact if isinstance(error, NoContact) else OperationError
                raise kind(self.reason) from error
            raise

    def _execute(self, *, single: bool) -> None:
        code, steps = self.program.instructions, 0
        while self._index < len(code):
            self._tick()
            instruction = code[self._index]
            if isinstance(instruction, Do):
                if single and steps:
                    self._show(instruction)
                    self.reason = f"one step was executed; the next is {self._where(instruction)}"
                    self._note(self.reason)
                    return
                self._do(instruction)
                steps += 1
            self._index = self._after(instruction)
        self.done, self.part = True, 0.0
        self._note(f"is done after {self.executed} steps")

    def _after(self, instruction: object) -> int:
        """Return the index of the instruction after one that was executed."""
        match instruction:
            case Begin():
                self._loops.append(Loop(self._index, 0))
            case Again(begin):
                loop, times = self._loops.pop(), self.program.instructions[begin]
                over = loop.times + 1
                if self._robot.clock.now_ns() == self._again_ns:  # no step has taken time
                    self._until(lambda: False, POLL_S)
                self._again_ns = self._robot.clock.now_ns()
                if isinstance(times, Begin) and (times.times is None or over < times.times):
                    self._loops.append(Loop(begin, over))
                    return begin + 1
            case Branch(condition, otherwise):
                if self._input(condition.input) is not condition.level:
                    return otherwise
            case Jump(target):
                return target
        return self._index + 1

    def _do(self, do: Do) -> None:
        self._show(do)
        self._note(f"step {self._where(do)}", do)
        self._await_speed()
        step = do.step
        if is_motion(step):
            self._move(step)
        elif step.gripper is not None:
            self._grip(step.gripper)
        elif step.output is not None:
            io = self._robot.io
            bit = bit_of("output", step.output.name, io.outputs, io.sizes[1])
            io.set_output_bit(*bit, step.output.on)
        elif step.wait is not None:
            self._wait(step.wait)
        elif step.tool is not None:
            self._planner.need_tool().select_tool(chosen(step.tool))
        elif step.work_frame is not None:
            self._planner.need_tool().select_work_frame(chosen(step.work_frame))
        elif step.payload is not None:
            self._robot.payload.set_payload(step.payload.payload)
        elif step.message is not None:
            self._tell(step.message.text, waits=step.message.wait)
        self.executed += 1

    def _move(self, step: Step) -> None:
        """Execute a motion, or what is left of it."""
        self._require_unmoved()
        here = self._planner.here()
        if self._unfinished is None:
            self._unfinished = Unfinished(self._planner.plan(step, here), 0.0)
        else:
            self._unfinished = Unfinished(self._rest(step, self._unfinished), 0.0)
        contact = self._planner.contact(step, here)
        self._follow(self._unfinished.motion, after=self.part, contact=contact)
        self._unfinished = None

    def _rest(self, step: Step, unfinished: Unfinished) -> ToolMotion:
        """Return what is left of a motion, with the arm on its path.

        Raises NotReady: it is too far off.
        """
        motion, limits = unfinished.motion, self._group.follower.limits
        place = self._planner.here()
        here = place.positions
        if here is None:
            raise NotReady("the positions of the joints are not known")
        time_s = place_on(motion, here, unfinished.time_s, REACH_S)
        on_path = positions_at(motion, time_s)
        self._require_near(here, on_path, "is {} off the path of the step", OFF_PATH)
        if np.abs(on_path - here).max() > ON_PATH:
            self._follow(plan_fast_motion(limits, here, on_path, RETURN_SPEED))
        return self._planner.rest(step, place, motion, time_s)

    def _follow(
        self,
        motion: ToolMotion,
        after: float | None = None,
        contact: ContactLimits | WrenchLimits | None = None,
    ) -> None:
        """Execute a motion.

        ``after``: part of the step that is over before; where the motion ends early is kept then.
        None: the motion leads to the path of the step only.
        ``contact``: at which it has to end.
        """
        self._tick()
        ticket, request = self._group.motion.ticket(), motion.request(self._group.joint_names)
        execution, outputs = None, OutputSetter(self._robot.io, motion.outputs)
        try:
            with self._group.follower.follow(request, ticket=ticket, contact=contact) as execution:
                if self._interruptions() != self._began:  # a stop that did not find it yet
                    raise NotReady("motion was stopped before this step began")
                while not self._has_ended(execution, motion, outputs, after):
                    pass
        finally:
            if execution is not None:
                if after is not None:
                    time_s = min(execution.progress().time_s, motion.duration_s)
                    self._unfinished = Unfinished(motion, time_s)
                self._left = self._group.motion.command()
        if execution.outcome is not (Outcome.SUCCEEDED if contact is None else Outcome.CONTACT):
            kind = NoContact if execution.outcome is Outcome.SUCCEEDED else OperationError
            raise kind(execution.message)
        if (found := execution.contact) is not None:
            self._note_contact(found, execution.message)
        else:
            outputs.advance(motion.duration_s)

    def _note_contact(self, contact: Contact, message: str) -> None:
        """Keep a contact, with the way from there to rest; note it as data, too."""
        rest = self._robot.image.copy().position[list(self._group.joint_axes)]
        stop = self._planner.distance_between(contact.positions, rest)
        number = self.step.number if self.step is not None else 0
        self.contact = FoundContact(number, contact, stop)
        data = {
            "at": contact.joint or contact.link,
            "change": contact.change,
            "unit": contact.unit,
            "stop": stop.value,
            "stop_unit": stop.unit,
        }
        self._note(f"{message}; at rest {stop} further", self.step, contact=data)

    def _has_ended(
        self,
        execution: TrajectoryExecution,
        motion: ToolMotion,
        outputs: OutputSetter,
        after: float | None,
    ) -> bool:
        """Wait for the end of a motion, and set its outputs; return False after a while."""

        def ended() -> bool:
            self._tick(in_motion=True)
            time_s = execution.progress().time_s
            outputs.advance(time_s)
            if after is not None:
                passed = min(max(time_s / motion.duration_s, 0.0), 1.0)
                self.part = after + (1.0 - after) * passed
            return execution.outcome is not None

        # An output is set at its place: every period is checked.
        poll_s = 1.0 / self._robot.descriptor.cycle.rate_hz if motion.outputs else POLL_S
        return wait_until(ended, WAIT_S, self._robot.clock, poll_s)

    def _grip(self, grip: SetGripper) -> None:
        gripper = gripper_of(self._robot, grip.name)
        errors: list[RobotdError] = []

        def ends() -> bool:
            try:
                self._tick()
            except RobotdError as error:
                errors.append(error)
            return bool(errors)

        state = gripper.move(grip_position(gripper, grip), ends)
        if errors:
            raise errors[0]
        if not state.at_rest:
            raise OperationError("the gripper got another command, or its fingers do not rest")

    def _wait(self, wait: Wait_) -> None:
        if wait.time_s is not None:
            self._until(lambda: False, wait.time_s)
            return
        level, name = wait.level is not False, str(wait.input)
        if not self._until(lambda: self._input(name) is level, wait.timeout_s):
            text = f"input {name} is not {'on' if level else 'off'} after {wait.timeout_s:g} s"
            raise OperationError(text)

    def _tell(self, text: str, *, waits: bool) -> None:
        self.message, self.confirmed = text, not waits
        self._note(f"message: {text}")
        try:
            self._until(lambda: self.confirmed)
        finally:
            self.confirmed = True

    def _await_speed(self) -> None:
        """Wait while motion is paused, or at speed 0."""
        speed = self._robot.axes.speed
        if not speed.scale:
            self._on_change()
            self._until(lambda: speed.scale > 0.0)
            self._on_change()

    def _until(self, condition: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Wait until ``condition``; return False after ``timeout_s``. Raises what ends it."""

        def reached() -> bool:
            self._tick()
            return condition()

        while True:
            limit_s = WAIT_S if timeout_s is None else timeout_s
            found = wait_until(reached, limit_s, self._robot.clock, POLL_S)
            if found or timeout_s is not None:
                return found

    def _input(self, name: str) -> bool:
        io = self._robot.io
        return io.input_bit(*bit_of("input", name, io.inputs, io.sizes[0]))

    def _tick(self, *, in_motion: bool = False) -> None:
        """Raise what ends the program."""
        self._on_tick()
        if not in_motion and (now := self._interruptions()) != self._began:
            raise NotReady(max(now).reason)

    def _interruptions(self) -> list[Interruption]:
        newest = self._robot.rearming.interruptions.newest
        return newest(self._group.joint_axes, in_mode=True, follows_speed=True)

    def _require_ready(self) -> None:
        """Raise NotReady while a state rejects motion; an interruption from now on ends it."""
        self._began = self._interruptions()
        axes = self._group.joint_axes
        modes = [CommandMode.POSITION] * len(axes)
        error = self._robot.rearming.interruptions.present(axes, modes, follows_speed=True)
        if error is not None:
            raise error

    def _require_unmoved(self) -> None:
        """Raise NotReady where the arm is not where the program has left it."""
        here, left = self._planner.here().positions, self._left
        if here is None or left is None:
            return
        self._require_near(here, left, "was moved by {} since the last step", MOVED)

    def _require_near(
        self, here: FloatArray, there: FloatArray, what: str, limits: Mapping[str, float]
    ) -> None:
        units = self._group.follower.limits.units
        for joint, name in enumerate(self._group.joint_names):
            away, limit = abs(float(here[joint] - there[joint])), limits[units[joint]]
            if not away <= limit:
                text = f"{name} {what.format(f'{away:.3f} {units[joint]}')}"
                advice = "move it back, or run the program anew"
                raise NotReady(f"{text}, at most {limit:g} {units[joint]}: {advice}")

    def _show(self, do: Do) -> None:
        if self._unfinished is None:
            self.part = 0.0
        self.step = do

    def _where(self, do: Do) -> str:
        return f"{do.number} of {self.program.steps}, {do.text} ({self.program.path}:{do.line})"

    def _stopped(self, error: BaseException) -> None:
        """Note an early end."""
        text = str(error) or type(error).__name__
        if self.step is None:
            self.reason = f"{self.program.path} stopped before its first step: {text}"
        else:
            place = self.program.problem(self.step.keys, "")
            where = f"{place.path}:{place.line}: {place.key}"
            number = f"step {self.step.number} of {self.program.steps}"
            self.reason = f"{where}: stopped at {number}: {text}"
        self._note(self.reason, self.step, Level.WARNING)

    def _note(
        self, text: str, do: Do | None = None, level: Level = Level.INFO, **more: object
    ) -> None:
        """Note what the program does with the robot's events, and so in recordings."""
        data: dict[str, object] = {"program": str(self.program.path), "executed": self.executed}
        data |= more
        if do is not None:
            data |= {"step": do.number, "key": do.key, "line": do.line}
        whole = f"program {self.program.path}: {text}"
        self._robot.events.add(EventKind.STATE, SUBJECT, whole, level=level, data=data)
        self._on_change()
