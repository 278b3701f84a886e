"""Commands of the page's panel: poses, paths and programs, each a call of the feature."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import Field

from robotd.api import DescriptorError, NotReady, OperationError
from robotd.api.robots import Robot
from robotd_page.control_commands import Access, Command, Finite, Question
from robotd_teach import program_edit
from robotd_teach.joint_groups import joint_group, measured_positions
from robotd_teach.paths import Paths
from robotd_teach.poses import Poses
from robotd_teach.program_code import Program
from robotd_teach.program_folder import ProgramFolder
from robotd_teach.program_outline import outline
from robotd_teach.programs import ACTIVE, Programs

PLACE = re.compile(r".*?:(\d+): ")  # file and line of an error


class Harmless(Command):
    """Base of the commands that move nothing, or end what moves."""

    def is_always_allowed(self, robot: Robot) -> bool:
        return True


class SavePose(Command):
    """Keep where the joints are."""

    type: Literal["pose_save"]
    name: str
    group: str
    replace: bool

    def run(self, access: Access) -> str:
        access.robot.feature(Poses).save(self.name, self.group, replace=self.replace)
        return f"pose {self.name} is saved"


class RenameTaught(Harmless):
    """Give a pose or a path another name."""

    type: Literal["rename"]
    kind: Literal["pose", "path"]
    name: str
    new_name: str

    def run(self, access: Access) -> str:
        _taught(access.robot, self.kind).rename(self.name, self.new_name)
        return f"{self.name} is called {self.new_name} now"


class DeleteTaught(Harmless):
    """Delete a pose or a path."""

    type: Literal["delete"]
    kind: Literal["pose", "path"]
    name: str

    def run(self, access: Access) -> str:
        _taught(access.robot, self.kind).delete(self.name)
        return f"{self.name} is deleted"


class BeginRecording(Command):
    """Begin to record a path."""

    type: Literal["path_begin"]
    name: str
    group: str
    replace: bool

    def run(self, access: Access) -> str:
        return access.robot.feature(Paths).begin(self.name, self.group, replace=self.replace)


class EndRecording(Harmless):
    """End a recording and save its path."""

    type: Literal["path_end"]

    def run(self, access: Access) -> str:
        return access.robot.feature(Paths).end()


class ShowProgram(Question):
    """Question for the steps of a program's file, or what is wrong with it."""

    type: Literal["program_show"]
    name: str

    def run(self, access: Access) -> dict[str, Any]:
        folder = access.robot.feature(ProgramFolder)
        version = folder.all().get(self.name, "")
        try:
            program = folder.read(self.name)
        except DescriptorError as error:
            return {"version": version, "rows": [], "speed": 0.0, "problems": _problems(error)}
        speed = program.file.speed
        return {"version": version, "rows": outline(program), "speed": speed, "problems": []}


class CheckProgram(Question):
    """Question for what is wrong with a program, from where the arm is."""

    type: Literal["program_check"]
    name: str

    def run(self, access: Access) -> dict[str, Any]:
        try:
            program = access.robot.feature(ProgramFolder).read(self.name)
            access.robot.feature(Programs).check(program, lambda: _require_client(access))
        except DescriptorError as error:
            return {"problems": _problems(error), "text": ""}
        return {"problems": [], "text": f"{program.steps} steps can be executed from here"}


class NewProgram(Command):
    """Write a program with one step, the present pose."""

    type: Literal["program_new"]
    name: str
    group: str

    def run(self, access: Access) -> str:
        step = program_edit.move_to(_present(access.robot, self.group))
        head = f"group: {self.group}\n" if self.group else ""
        access.robot.feature(ProgramFolder).create(self.name, f"{head}steps:\n  - {step}\n")
        return f"program {self.name} is written"


class EditProgram(Command):
    """Change one thing in the file of a program.

    Attributes:
        version: of the file that the page has shown.
        keys: of the step; none: the program itself.
        edit: "up", "down" or "delete" of the step; "pose", its target is the present pose; "add",
            a move to the present pose after it; else the number to be set.
        value: of the number; None: the step has none of its own.
    """

    type: Literal["program_edit"]
    name: str
    version: str
    keys: Annotated[tuple[str | int, ...], Field(max_length=64)]
    edit: Literal["up", "down", "delete", "pose", "add", "speed", "blend_m"]
    value: Finite | None = None

    def run(self, access: Access) -> str:
        folder = access.robot.feature(ProgramFolder)
        program, state = folder.read(self.name), access.robot.feature(Programs).state
        if state.state in ACTIVE and state.file == str(program.path):
            raise NotReady(f"{self.name} runs: stop it before it is changed")
        change = self._change(access.robot, program)
        folder.change(self.name, self.version, change)
        return f"{self.name} is saved"

    def _change(self, robot: Robot, program: Program) -> Callable[[str], str]:
        keys = self.keys
        if self.edit in ("up", "down"):
            by = -1 if self.edit == "up" else 1
            return lambda text: program_edit.with_step_moved(text, keys, by)
        if self.edit == "delete":
            return lambda text: program_edit.without_step(text, keys)
        value_keys = (*keys, _kind(program, keys)) if keys else ()
        if self.edit in ("speed", "blend_m"):
            return lambda text: program_edit.with_number(text, value_keys, self.edit, self.value)
        present = _present(robot, program.file.group)
        if self.edit == "add":
            return lambda text: program_edit.with_move_after(text, keys, present)
        return lambda text: program_edit.with_joints(text, value_keys, present)


class RunProgram(Command):
    """Run a program, or execute one step of it; it is stopped when its page has left."""

    type: Literal["program_run"]
    name: str
    single: bool

    def run(self, access: Access) -> str:
        programs = access.robot.feature(Programs)
        program = access.robot.feature(ProgramFolder).read(self.name)
        execute = programs.step if self.single else programs.run
        execute(program, lambda: _require_client(access))
        return _ended(programs, self.name)


class ResumeProgram(Command):
    """Continue the program that is paused, was stopped, or waits for the operator."""

    type: Literal["program_resume"]
    name: str

    def run(self, access: Access) -> str:
        programs = access.robot.feature(Programs)
        if programs.state.state in ACTIVE:
            programs.proceed()
            return "the program goes on"
        program = access.robot.feature(ProgramFolder).read(self.name)
        if not programs.is_unfinished(program):
            raise NotReady(f"{self.name} is not the program that was stopped: run it anew")
        programs.resume(lambda: _require_client(access))
        return _ended(programs, self.name)


class PauseProgram(Harmless):
    """Pause all motion, and so the program that runs."""

    type: Literal["program_pause"]

    def run(self, access: Access) -> str:
        return access.robot.feature(Programs).pause()


class StopProgram(Harmless):
    """Stop the program that runs, on its path."""

    type: Literal["program_stop"]

    def run(self, access: Access) -> str:
        return access.robot.feature(Programs).stop()


COMMANDS = (
    SavePose,
    RenameTaught,
    DeleteTaught,
    BeginRecording,
    EndRecording,
    ShowProgram,
    CheckProgram,
    NewProgram,
    EditProgram,
    RunProgram,
    ResumeProgram,
    PauseProgram,
    StopProgram,
)


def _taught(robot: Robot, kind: str) -> Poses | Paths:
    return robot.feature(Poses) if kind == "pose" else robot.feature(Paths)


def _present(robot: Robot, group: str) -> dict[str, float]:
    """Return where the joints of a group are, rad or m. Raises NotReady."""
    joints = joint_group(robot, group)
    robot.connection.require_ready()
    positions = measured_positions(robot, joints).tolist()
    return dict(zip(joints.joint_names, positions, strict=True))


def _kind(program: Program, keys: tuple[str | int, ...]) -> str:
    """Return the key of a step. Raises InvalidArgument: there is none."""
    rows = [row for row in outline(program) if row["keys"] == [*keys]]
    if not rows:
        raise NotReady("the program has no such step any more: look, and do it again")
    kind: str = rows[0]["kind"]
    return kind


def _problems(error: DescriptorError) -> list[dict[str, Any]]:
    """Return line (null: none) and text of each mistake."""
    found = []
    for text in str(error).splitlines():
        place = PLACE.match(text)
        line = int(place[1]) if place else None
        found.append({"line": line, "text": text[place.end() :] if place else text})
    return found


def _require_client(access: Access) -> None:
    """Raise OperationError once the page has left."""
    if access.has_left():
        raise OperationError("the page that ran the program has left")


def _ended(programs: Programs, name: str) -> str:
    state = programs.state
    return state.reason or f"{name}: {state.executed} steps were executed"
