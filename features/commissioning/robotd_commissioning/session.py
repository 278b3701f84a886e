"""Commissioning of one joint: open steps in order, each written before the next one."""

from __future__ import annotations

import difflib
import io
import json
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from ruamel.yaml.comments import CommentedSeq

from robotd.api import (
    AxisKeys,
    DescriptorError,
    InvalidArgument,
    MonotonicClock,
    PluginError,
    unknown_name,
)
from robotd.api.commands import stop_signals
from robotd.api.features import requested_guards
from robotd.api.models import (
    JointSettings,
    RobotDescriptor,
    is_file,
    read_limited,
    validate_section,
)
from robotd.api.robots import Backend, Robot
from robotd_commissioning.commissioned_axis import CommissionedAxis
from robotd_commissioning.findings import Change, DescriptorPart, StepFinding
from robotd_commissioning.steps import STEPS, Bench, Operator
from robotd_shared.commented_yaml import commented_yaml, on_one_line

MAX_BYTES = 1_000_000


class DescriptorEdit:
    """Text of a robot's file with changes of one axis. Writes nothing before ``save``.

    Args:
        robot: loaded from a file.
        joint: whose axis it is.
        backend: name of the section.

    Raises DescriptorError: the robot has no file, or the axis is described in one that it extends.
    """

    def __init__(
        self, robot: RobotDescriptor, joint: JointSettings, backend: str, keys: AxisKeys
    ) -> None:
        if robot.path is None:
            raise DescriptorError(f"{robot.name} has no file to write to")
        self.path = robot.path
        self._variant, self._backend, self._keys, self._joint = robot.variant, backend, keys, joint
        self.before = self.path.read_text(encoding="utf-8")
        self._tree = commented_yaml().load(self.before)
        self._joint_item = self._find(["joints"], "name", joint.name)
        self._drive_item = self._find(["backends", backend, keys.items], "axis", joint.axis)

    def changed(self, changes: Sequence[Change]) -> str:
        """Return the text with ``changes``."""
        for change in changes:
            item = self._joint_item if change.place is DescriptorPart.JOINT else self._drive_item
            if change.key == self._keys.window_object:
                _set_startup(item, change.key, change.value)
            else:
                item[change.key] = on_one_line(change.value)
        text = io.StringIO()
        commented_yaml().dump(self._tree, text)
        return text.getvalue()

    def difference(self, text: str) -> str:
        """Return the unified diff from the file to ``text``."""
        lines = difflib.unified_diff(
            self.before.splitlines(keepends=True),
            text.splitlines(keepends=True),
            str(self.path),
            f"{self.path} (new)",
            n=1,
        )
        return "".join(lines)

    def save(self, text: str, check: Callable[[Path], object]) -> None:
        """Replace the file by ``text`` at once, after ``check`` of a copy beside it.

        Raises what ``check`` raises, and DescriptorError where the folder cannot be written; the
        file is unchanged then.
        """
        copy = self.path.with_name(f".{self.path.stem}.new.yaml")
        try:
            newline = "\r\n" if b"\r\n" in self.path.read_bytes() else None
            copy.write_text(text, encoding="utf-8", newline=newline)
            check(copy)
            _replace(self.path, text, newline)
        except OSError as error:
            raise DescriptorError(f"cannot be written: {error.strerror}", path=self.path) from None
        finally:
            copy.unlink(missing_ok=True)

    def _find(self, keys: list[str], name: str, value: Any) -> Any:
        """Return the item of a list in this file whose ``name`` is ``value``."""
        for prefix in [["variants", self._variant], []] if self._variant else [[]]:
            node = self._tree
            for key in (*prefix, *keys):
                node = node.get(key) if isinstance(node, Mapping) else None
            for item in node or ():
                if item.get(name) == value:
                    return item
        where = ".".join(keys)
        what = (
            f"has no item with {name}: {value} in this file, but in one that it extends: copy the"
            " list into this file, which keeps what this machine needs"
        )
        raise DescriptorError(what, path=self.path, key=where)


def _replace(path: Path, text: str, newline: str | None = None) -> None:
    """Replace the content of a file at once; it may be new. A symbolic link stays one."""
    file = path.resolve()
    copy = file.with_name(f".{file.name}.new")
    try:
        copy.write_text(text, encoding="utf-8", newline=newline)
        if file.exists():
            copy.chmod(file.stat().st_mode)
        copy.replace(file)
    finally:
        copy.unlink(missing_ok=True)


def _set_startup(item: Any, name: str, value: int) -> None:
    """Set the start-up object ``name`` to ``value``."""
    startup = item.get("startup")
    if startup is None:
        startup = item["startup"] = CommentedSeq()
        startup.fa.set_flow_style()
    for write in startup:
        if str(write.get("object")).lower() == name.lower():
            write["value"] = value
            return
    startup.append(on_one_line({"object": name, "value": value}))


class _Content(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    joints: dict[str, dict[str, str]] = {}  # joint → step → finding


class CommissionRecord:
    """Findings by joint and step. One thread.

    Args:
        robot: the robot's file; the record is ``<name>.commission.json`` beside it.

    Raises DescriptorError: the file is there and is not a record.
    """

    def __init__(self, robot: Path) -> None:
        self.path = robot.with_name(f"{robot.stem}.commission.json")
        self._content = _Content()
        if is_file(self.path):
            try:
                data = read_limited(self.path, MAX_BYTES)
                self._content = _Content.model_validate_json(data)
            except ValidationError as error:
                what = f"is not a record of a commissioning: {error.errors()[0]['msg']}; delete it"
                raise DescriptorError(what, path=self.path) from None

    def finding(self, joint: str, step: str) -> str | None:
        """Return the finding of a finished step; None of an open one."""
        return self._content.joints.get(joint, {}).get(step)

    def note(self, joint: str, step: str, text: str) -> None:
        """Keep a finding, in the file too. Raises DescriptorError: it cannot be written."""
        self._content.joints.setdefault(joint, {})[step] = text
        self._save()

    def forget(self, joint: str) -> None:
        """Open all steps of a joint again."""
        if self._content.joints.pop(joint, None) is not None:
            self._save()

    def _save(self) -> None:
        try:
            _replace(self.path, json.dumps(self._content.model_dump(), indent=2) + "\n")
        except OSError as error:
            raise DescriptorError(f"cannot be written: {error.strerror}", path=self.path) from None


class Commissioning:
    """Steps of one joint, from the first open one on. One thread.

    The robot is opened with this joint alone, servo off, and opened again after each change, so
    that the next step runs on what was written.

    Args:
        load: loads the descriptor as it is now, from its file or from another one.
        record: finished steps.

    Raises:
        PluginError: the backend has no keys that commissioning could write.
        InvalidArgument: there is no such joint.
        DescriptorError: the robot's file asks for guards, which need all joints.
    """

    def __init__(
        self,
        load: Callable[[Path | None], RobotDescriptor],
        backend: Backend,
        joint: str,
        record: CommissionRecord,
        make_operator: Callable[[CommissionedAxis], Operator],
    ) -> None:
        keys = backend.info.axis_keys
        if keys is None:
            raise PluginError(
                f"the backend {backend.name} keeps no scale and direction in the descriptor,"
                " so that commissioning has nothing to write: set them in the backend's own files"
                " (wmx: AxisGearRatio and AxisPolarity in parameters_file, checked by 'robotd wmx"
                " doctor'), see robotd docs how-to/commission"
            )
        self._load, self._backend, self._keys = load, backend, keys
        self._joint, self._record, self._make_operator = joint, record, make_operator
        descriptor = load(None)
        _joint_of(descriptor, joint)
        text = f"needs all joints, and {joint} is commissioned alone; to do without, give"
        without = "and keep its path free"
        if guards := requested_guards(descriptor):
            raise DescriptorError.join(
                descriptor.problem(key, f"{text} --set {key}=null, {without}") for key in guards
            )

    @property
    def open_steps(self) -> list[str]:
        """Names of the steps that are not finished, in their order."""
        return [step for step in STEPS if self._record.finding(self._joint, step) is None]

    def run(self) -> bool:
        """Run the open steps; return False when the operator rejects a change.

        Raises:
            OperationError: a measured value cannot be right; the step stays open.
            ConnectError: the robot does not start, for example because of another identity.
        """
        warned = False
        while self.open_steps:
            with self._opened() as (bench, edit):
                for caution in () if warned else bench.axis.cautions:
                    bench.operator.say(f"CAUTION: {caution}")
                warned = True
                for step in self.open_steps:
                    operator = bench.operator
                    operator.say(f"\n{self._joint}: {step}")
                    finding = STEPS[step](bench)
                    operator.say(finding.text)
                    if finding.changes and not self._write(edit, finding, operator):
                        return False
                    self._record.note(self._joint, step, finding.text)
                    if finding.changes:
                        break
        return True

    def _write(self, edit: DescriptorEdit, finding: StepFinding, operator: Operator) -> bool:
        text = edit.changed(finding.changes)
        if not operator.accepts(edit.difference(text)):
            return False
        edit.save(text, self._check)
        return True

    def _check(self, path: Path) -> None:
        """Raise DescriptorError where the new file is wrong."""
        self._backend.context(self._load(path))

    @contextmanager
    def _opened(self) -> Iterator[tuple[Bench, DescriptorEdit]]:
        descriptor = self._load(None)
        joint = _joint_of(descriptor, self._joint)
        edit = DescriptorEdit(descriptor, joint, self._backend.name, self._keys)
        drive = _drive_of(descriptor, joint, self._backend, self._keys)
        alone: dict[str, Any] = {"joints": (joint,), "groups": {}, "drive": None, "gripper": None}
        robot = Robot(descriptor.model_copy(update=alone), self._backend, MonotonicClock())
        try:
            robot.start(enable=False)
            axis = CommissionedAxis(robot)
            yield Bench(axis, self._make_operator(axis), drive, self._keys), edit
        finally:
            with _uninterrupted():
                robot.shutdown()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Defer Ctrl-C and the loss of the terminal, however often they come, to the end."""
    came: list[int] = []
    before = {
        number: signal.signal(number, lambda number, _: came.append(number))
        for number in stop_signals()
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            raise KeyboardInterrupt


def _joint_of(descriptor: RobotDescriptor, name: str) -> JointSettings:
    for joint in descriptor.joints:
        if joint.name == name:
            return joint
    raise InvalidArgument(unknown_name("joint", name, descriptor.joint_names))


def _drive_of(
    descriptor: RobotDescriptor, joint: JointSettings, backend: Backend, keys: AxisKeys
) -> Mapping[str, Any]:
    """Return the validated item of the backend's section, with its defaults."""
    section = f"backends.{backend.name}"
    options = validate_section(descriptor, section, backend.info.options).model_dump()
    for item in options[keys.items]:
        if item["axis"] == joint.axis:
            found: Mapping[str, Any] = item
            return found
    what = f"has no item with axis: {joint.axis}, which {joint.name} needs"
    raise DescriptorError(what, path=descriptor.path, key=f"{section}.{keys.items}")
