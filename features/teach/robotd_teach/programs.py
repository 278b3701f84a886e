"""Programs of a robot: checked, run, stopped, and continued."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from robotd.api import NotReady, OperationError
from robotd.api.robots import Robot
from robotd_shared.pose_file import read_poses
from robotd_teach.paths import Paths
from robotd_teach.poses import Poses
from robotd_teach.program_check import ProgramCheck
from robotd_teach.program_code import Program
from robotd_teach.program_motion import Place, StepPlanner
from robotd_teach.program_run import FoundContact, ProgramRun

OPERATOR = "by the operator"
ACTIVE = ("running", "paused", "waiting")  # states of a program in execution


class ProgramState(NamedTuple):
    """State of the newest program.

    Attributes:
        state: "none", "running", "paused", "waiting" for the operator, "stopped" or "done".
        file: of the program.
        step: number of the step, from 1; 0: before the first.
        steps: number of steps; those of blocks count where they are called.
        executed: number of steps that were executed; repeated ones count each time.
        progress: 0 to 1 of the motion of this step.
        key, line: of the step in the file.
        text: of the step.
        message: last text for the operator.
        reason: why it has stopped.
    """

    state: str = "none"
    file: str = ""
    step: int = 0
    steps: int = 0
    executed: int = 0
    progress: float = 0.0
    key: str = ""
    line: int = 0
    text: str = ""
    message: str = ""
    reason: str = ""


class Programs:
    """Programs of a robot: ``robot.feature(Programs)``. One runs at a time.

    Nothing runs by itself: not after the start of robotd, and not after a stop, a fault or a reset.

    Attributes:
        on_change: called after each change of the state, in the thread that made it.
    """

    def __init__(self, robot: Robot) -> None:
        self.on_change: Callable[[], None] = lambda: None
        self._robot = robot
        self._poses, self._paths = robot.feature(Poses), robot.feature(Paths)
        self._run: ProgramRun | None = None
        self._busy = threading.Lock()  # held while a program is checked and executed
        self._active: ProgramRun | None = None  # in execution
        self._stopped = ""  # by whom
        self._passed: tuple[Any, ...] | None = None  # what passed the last check
        robot.axes.speed.on_change(lambda scale: self._changed())

    @property
    def state(self) -> ProgramState:
        """State of the newest program. Any thread."""
        run = self._run
        if run is None:
            return ProgramState()
        step, program = run.step, run.program
        name = "done" if run.done else "stopped"
        if run is self._active:
            name = "running" if self._robot.axes.speed.scale else "paused"
            name = name if run.confirmed else "waiting"
        return ProgramState(
            name,
            str(program.path),
            step.number if step else 0,
            program.steps,
            run.executed,
            run.part,
            step.key if step else "",
            (step.line or 0) if step else 0,
            step.text if step else "",
            run.message,
            "" if name != "stopped" else run.reason,
        )

    @property
    def contact(self) -> FoundContact | None:
        """Contact that ended the last step with ``until`` of the newest program. Any thread.

        None: no step of it has ended at one.
        """
        return None if self._run is None else self._run.contact

    def check(self, program: Program, wait: Callable[[], None] = lambda: None) -> None:
        """Check a whole program from where the arm is. Nothing moves. Any worker thread.

        ``wait``: called between the steps; what it raises ends the check.

        Raises:
            DescriptorError: what is wrong, with file, line and key.
            InvalidArgument: the robot has no such joint group.
            NotReady: it is not known where the arm is, or it moves.
        """
        self._checked(program, wait)

    def run(self, program: Program, on_tick: Callable[[], None] = lambda: None) -> None:
        """Check a program and execute it from its first step; return at its end, at rest.

        Any worker thread; a stepped clock is stepped.

        ``on_tick``: called all the time; what it raises ends the program.

        Raises:
            DescriptorError, InvalidArgument: as ``check``; nothing has moved.
            NotReady: another program runs, or the robot cannot move; nothing has moved.
            OperationError: the program was stopped, with step and reason. ``resume`` continues it.
            NoContact: the same, by a motion with ``until`` that has met nothing.
        """
        with self._exclusively(on_tick) as tick:
            self._go(self._begin(program, tick), tick)

    def step(self, program: Program, on_tick: Callable[[], None] = lambda: None) -> None:
        """Execute one step: the next one of the program that was stopped, if it is the same.

        Otherwise its first one. Arguments and errors: see ``run``.
        """
        with self._exclusively(on_tick) as tick:
            run = self._run if self.is_unfinished(program) else None
            self._go(run or self._begin(program, tick), tick, single=True)

    def resume(self, on_tick: Callable[[], None] = lambda: None) -> None:
        """Continue the program that was stopped, and return at its end, at rest.

        The motion of its step is continued on its path, from rest. Arguments and errors: see
        ``run``; NotReady, too: no program was stopped since the start of robotd, or the arm was
        moved since.
        """
        with self._exclusively(on_tick) as tick:
            if self._run is None or self._run.done:
                raise NotReady("no program was stopped since robotd was started: run one")
            self._go(self._run, tick)

    def is_unfinished(self, program: Program) -> bool:
        """Return True where the newest program is this one, unchanged, and not at its end."""
        run = self._run
        return run is not None and not run.done and run.program.text == program.text

    def stop(self, reason: str = OPERATOR) -> str:
        """Stop the program that is checked or runs, on its path. Any thread; does not block.

        Raises NotReady: none runs.
        """
        if not self._busy.locked():
            raise NotReady("no program runs")
        self._stopped = reason
        return "the program is stopped"

    def pause(self) -> str:
        """Pause all motion of the robot on its path, and so the program. Any thread.

        Raises NotReady: no program runs; the errors of ``Robot.pause``.
        """
        run = self._running()
        self._robot.pause()
        return f"{run.program.path} is paused"

    def proceed(self) -> str:
        """Let a program go on that is paused, or waits for the operator. Any thread.

        Raises NotReady: none runs.
        """
        run = self._running()
        run.confirmed = True
        self._robot.resume()
        return f"{run.program.path} goes on"

    def _changed(self) -> None:
        self.on_change()  # whichever is set by then

    def _running(self) -> ProgramRun:
        if (run := self._active) is None:
            raise NotReady("no program runs")
        return run

    @contextmanager
    def _exclusively(self, on_tick: Callable[[], None]) -> Iterator[Callable[[], None]]:
        """Admit one program; yield what it has to call all the time."""

        def tick() -> None:
            if self._stopped:
                raise OperationError(self._stopped)
            on_tick()

        if not self._busy.acquire(blocking=False):
            raise NotReady("a program runs already: stop it first")
        try:
            self._stopped = ""
            yield tick
        finally:
            self._busy.release()

    def _go(self, run: ProgramRun, tick: Callable[[], None], *, single: bool = False) -> None:
        self._active = run
        try:
            run.go(tick, single=single)
        finally:
            self._active = None
            self._changed()

    def _begin(self, program: Program, wait: Callable[[], None]) -> ProgramRun:
        planner = self._checked(program, wait)
        self._run = ProgramRun(self._robot, program, planner, self._changed)
        return self._run

    def _checked(self, program: Program, wait: Callable[[], None]) -> StepPlanner:
        """Return the planner of a program that has passed its check."""
        taught = read_poses(self._poses.path)
        problems = self._poses.problems() if taught else {}
        paths = self._paths.read(program.paths)
        planner = StepPlanner(self._robot, program.file, taught, paths, problems)
        place = planner.here()
        subject = program.path, program.text, taught, problems, paths, _numbers(place)
        if subject != self._passed:
            ProgramCheck(self._robot, program, planner, wait).run(place)
            self._passed = subject
        return planner


def _numbers(place: Place) -> tuple[object, ...]:
    positions = None if place.positions is None else place.positions.tobytes()
    return positions, place.tool, place.work_frame
