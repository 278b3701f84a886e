"""File of a program: its keys, and what each step may have."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from robotd.api import Payload
from robotd.api.features import Name, NotNegative, Section, SectionProblem
from robotd.api.models import YamlNode, parse_yaml, validate
from robotd_teach.path_motion import PathTiming
from robotd_teach.paths import Playback

DEFAULT_SPEED = 0.2
MAX_TIME_S = 86_400.0
MAX_TIMES = 1_000_000
MAX_ANGLE = 12.5  # of an arc about a centre, rad

Speed = Annotated[float, Field(ge=0.01, le=1.0)]
Seconds = Annotated[float, Field(gt=0, le=MAX_TIME_S)]
Limit = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1, max_length=500)]
# YAML reads 0.3, byte 0 and bit 3, as a number.
IoName = Annotated[
    str, BeforeValidator(lambda value: str(value) if type(value) is float else value)
]
JointPositions = dict[str, float]


class Components(Section):
    """Components of a pose of the tool: m and rad, about fixed axes."""

    x: float | None = None
    y: float | None = None
    z: float | None = None
    roll: float | None = None
    pitch: float | None = None
    yaw: float | None = None

    @property
    def given(self) -> dict[str, float]:
        """Those that are not null."""
        return self.model_dump(exclude_none=True)


class Target(Section):
    """Target of a motion: exactly one of ``pose``, ``joints``, ``at`` and ``by``.

    Attributes:
        pose: name of a pose: of the program, or a taught one.
        joints: positions by name, rad or m; joints that are not named stay.
        at: of the tool in the work frame; components that are not named stay.
        by: displacement of the tool from where it is, along the axes of ``frame``.
        frame: of ``by``: "base" is the work frame, or the base of the arm; "tool" the tool.
    """

    pose: str | None = None
    joints: Annotated[JointPositions, Field(min_length=1)] | None = None
    at: Components | None = None
    by: Components | None = None
    frame: Literal["base", "tool"] | None = None

    def problems(self) -> Iterator[SectionProblem]:
        yield from _one_of(self, ("pose", "joints", "at", "by"))
        if self.frame is not None and self.by is None:
            yield ("frame",), "belongs to `by`", self.frame


class Until(Section):
    """Contact at which a motion ends: by ``torque``, or by ``force_n`` and ``torque_nm``.

    Attributes:
        torque: change of a joint's torque since the motion began, N·m or N: of any joint, or of
            some by name.
        force_n, torque_nm: of the wrench at the tool; the first that is exceeded.
        bias: of the wrench: that at the start of the motion is subtracted; null: it is.
        axis: of ``frame``, along which the force counts, and about which the torque does: of both
            signs, or of the one before it; null: in any direction.
        frame: of ``axis``: "base" is the work frame, or the base of the arm; "tool" the tool; null
            is "base".
    """

    torque: Limit | Annotated[dict[Name, Limit], Field(min_length=1)] | None = None
    force_n: Limit | None = None
    torque_nm: Limit | None = None
    bias: bool | None = None
    axis: Literal["x", "y", "z", "+x", "+y", "+z", "-x", "-y", "-z"] | None = None
    frame: Literal["base", "tool"] | None = None

    def problems(self) -> Iterator[SectionProblem]:
        kinds = ("torque",), ("force_n",), ("torque_nm",), ("force_n", "torque_nm")
        given = tuple(key for key, _ in _given(self, ("torque", "force_n", "torque_nm")))
        if given not in kinds:
            yield (), "needs torque, or force_n and torque_nm or one of them", ", ".join(given)
        for key, value in _given(self, ("bias", "axis")):
            if self.torque is not None:
                yield (key,), "belongs to `force_n` and `torque_nm`", value
        if self.frame is not None and self.axis is None:
            yield ("frame",), "belongs to `axis`", self.frame


class MoveToPose(Target):
    """Motion of all joints together, directly to a target, or until a contact on the way."""

    speed: Speed | None = None
    until: Until | None = None


class MoveOnLine(Target):
    """Straight line of the tool to a target, or until a contact on the way."""

    speed: Speed | None = None
    until: Until | None = None


class MoveOnArc(Section):
    """Arc of a circle: through ``via`` to ``to``, or about the z axis of ``centre``.

    Attributes:
        via, to, centre: from where the tool is.
        angle: about ``centre``, rad, of either sign.
        turns: about ``centre`` the tool turns with the arc; null: it does.
    """

    via: Target | None = None
    to: Target | None = None
    centre: Target | None = None
    angle: Annotated[float, Field(ge=-MAX_ANGLE, le=MAX_ANGLE)] | None = None
    turns: bool | None = None
    speed: Speed | None = None

    def problems(self) -> Iterator[SectionProblem]:
        given = tuple(key for key, _ in _given(self, ("via", "to", "centre", "angle")))
        if given not in (("via", "to"), ("centre", "angle")):
            yield (), "needs via and to, or centre and angle", ", ".join(given) or None
        if self.turns is not None and self.centre is None:
            yield ("turns",), "belongs to `centre`", self.turns


class MoveOnSpline(Section):
    """Smooth curve through targets, each seen from the one before."""

    through: Annotated[list[Target], Field(min_length=1)]
    speed: Speed | None = None


class OutputOnPath(Section):
    """Output that is set near the end of a segment; below 0: before it.

    Attributes:
        name: in the robot's file, or byte.bit.
        at_m: distance of the tool from the end.
        at_s: time from that place.
    """

    name: IoName
    on: bool
    at_m: float = 0.0
    at_s: float = 0.0


class SequenceSegment(Section):
    """Part of a sequence: exactly one of ``move``, ``line``, ``arc`` and ``spline``.

    Attributes:
        blend_m, blend_rad: bounds of the rounded corner to the next one; null: of the sequence.
        outputs: that are set near its end.
    """

    move: MoveToPose | None = None
    line: MoveOnLine | None = None
    arc: MoveOnArc | None = None
    spline: MoveOnSpline | None = None
    blend_m: NotNegative | None = None
    blend_rad: NotNegative | None = None
    outputs: list[OutputOnPath] = Field([])

    def problems(self) -> Iterator[SectionProblem]:
        yield from _one_of(self, ("move", "line", "arc", "spline"))
        for key, motion in (("move", self.move), ("line", self.line)):
            if motion is not None and motion.until is not None:
                kinds = [name for name, _ in _given(motion.until, tuple(Until.model_fields))]
                yield (key, "until"), "belongs to a step of its own", ", ".join(kinds)


class Sequence_(Section):  # noqa: N801 - beside that of collections.abc
    """One motion of many segments, each seen from the end of the one before.

    Attributes:
        speed, blend_m, blend_rad: of segments that have none of their own.
        constant_speed: the tool keeps one speed between two stops.
    """

    segments: Annotated[list[SequenceSegment], Field(min_length=1)]
    blend_m: NotNegative = 0.0
    blend_rad: NotNegative | None = None
    constant_speed: bool = False
    speed: Speed | None = None


class Path_(Section):  # noqa: N801 - beside that of pathlib
    """Straight lines of the tool through targets, or a recorded path: exactly one of both.

    Attributes:
        through: targets, each seen from the one before.
        blend_m: rounds the corners of ``through``.
        name: of a recorded path; the keys below belong to it.
        timing: what ``speed`` is a part of.
        reverse: from its end to its start.
        begin: part of its time that is left out first.
        approach: the joints go to where it begins first; otherwise they have to be there.
    """

    through: Annotated[list[Target], Field(min_length=1)] | None = None
    blend_m: NotNegative | None = None
    name: str | None = None
    timing: Literal["recorded", "limits"] | None = None
    reverse: bool | None = None
    begin: Annotated[float, Field(ge=0.0, lt=1.0)] | None = Field(None, alias="from")
    approach: bool | None = None
    speed: Speed | None = None

    def problems(self) -> Iterator[SectionProblem]:
        yield from _one_of(self, ("through", "name"))
        if self.name is not None and self.blend_m is not None:
            yield ("blend_m",), "belongs to `through`", self.blend_m
        for key, value in _given(self, ("timing", "reverse", "begin", "approach")):
            if self.name is None:
                yield (key,), "belongs to `name`", value

    def playback(self, speed: float) -> Playback:
        """Return how a recorded path is played; ``speed``: of the program."""
        timing = PathTiming(self.timing or PathTiming.RECORDED)
        of_limits = speed if timing is PathTiming.LIMITS else None
        chosen = of_limits if self.speed is None else self.speed
        return Playback(chosen, timing, bool(self.reverse), self.begin or 0.0)


class SetGripper(Section):
    """Target of a gripper.

    Attributes:
        to: "open", "close", or a position between them: m, or rad of a joint that turns.
        name: of a gripper that is a joint; "": the one on an output, or the only one.
    """

    to: Literal["open", "close"] | float
    name: str = ""


class SetOutput(Section):
    """Output by its name in the robot's file, or as byte.bit."""

    name: IoName
    on: bool


class Condition(Section):
    """Level of an input, by its name in the robot's file or as byte.bit."""

    input: IoName
    level: bool = Field(True, alias="is")


class SetPayload(Section):
    """Payload from this step on: gripper, tool and part together.

    Attributes:
        center_m: x, y and z of its centre of mass in the frame of the flange.
    """

    mass_kg: NotNegative
    center_m: tuple[float, float, float] = Field((0.0, 0.0, 0.0), strict=False)

    @property
    def payload(self) -> Payload:
        """The payload as the robot's type."""
        return Payload(self.mass_kg, self.center_m)


class Wait_(Section):  # noqa: N801 - beside that of sequences
    """Wait for a time, or for an input.

    Attributes:
        timeout_s: of an input, after which the program stops; null: none.
    """

    time_s: Seconds | None = None
    input: IoName | None = None
    level: bool | None = Field(None, alias="is")
    timeout_s: Seconds | None = None

    def problems(self) -> Iterator[SectionProblem]:
        yield from _one_of(self, ("time_s", "input"))
        for key, value in (("is", self.level), ("timeout_s", self.timeout_s)):
            if value is not None and self.input is None:
                yield (key,), "belongs to `input`", value


class ShowMessage(Section):
    """Text for the operator; with ``wait`` the program goes on when they resume it."""

    text: Text
    wait: bool = False


class Repeat(Section):
    """Steps that are repeated: ``times``, or without an end."""

    times: Annotated[int, Field(ge=1, le=MAX_TIMES)] | None = None
    steps: Annotated[list[Step], Field(min_length=1)]


class If(Condition):
    """Steps for an input at a level, and others where it is not."""

    steps: list[Step]
    otherwise: list[Step] = Field([], alias="else")


def _short(key: str) -> BeforeValidator:
    """Take a text for a section that has it in ``key``."""
    return BeforeValidator(lambda value: {key: value} if isinstance(value, str) else value)


class Step(Section):
    """One step: exactly one key."""

    move: MoveToPose | None = None
    line: MoveOnLine | None = None
    arc: MoveOnArc | None = None
    path: Path_ | None = None
    sequence: Sequence_ | None = None
    gripper: Annotated[SetGripper | None, _short("to")] = None
    output: SetOutput | None = None
    wait: Wait_ | None = None
    tool: str | None = None
    work_frame: str | None = None
    payload: SetPayload | None = None
    message: Annotated[ShowMessage | None, _short("text")] = None
    repeat: Repeat | None = None
    branch: If | None = Field(None, alias="if")
    call: str | None = None

    def problems(self) -> Iterator[SectionProblem]:
        yield from _one_of(self, tuple(type(self).model_fields))

    @property
    def needs_tool(self) -> bool:
        """True for a step that moves the tool on a path of its own."""
        is_recorded = self.path is not None and self.path.name is not None
        return self.kind in ("line", "arc", "path", "sequence") and not is_recorded

    @property
    def kind(self) -> str:
        """Key of the step in the file."""
        return next(key for key, _ in _given(self, tuple(type(self).model_fields)))

    @property
    def value(self) -> Any:
        """Value of its key."""
        return next(value for _, value in _given(self, tuple(type(self).model_fields)))


class ProgramFile(Section):
    """Content of a file.

    Attributes:
        group: joint group that moves; "": the only one.
        speed: of motion that has none of its own: part of the limits of the joints, or of the speed
            of the tool.
        poses: positions by joint, by pose; they come before taught poses of the same name.
        blocks: steps by the name with which they are called.
    """

    group: str = ""
    speed: Speed = DEFAULT_SPEED
    poses: dict[Name, JointPositions] = Field({})
    blocks: dict[Name, list[Step]] = Field({})
    steps: Annotated[list[Step], Field(min_length=1)]


def parse_program(text: str, path: Path) -> tuple[ProgramFile, YamlNode]:
    """Return the content of a program's text, and its tree with the lines.

    ``path``: of its file, for errors; it is not opened. Raises DescriptorError with every mistake.
    """
    tree = parse_yaml(text, path)
    return validate(ProgramFile, tree.plain(), tree), tree


def _given(section: Section, names: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    fields = type(section).model_fields
    for name in names:
        if (value := getattr(section, name)) is not None:
            yield fields[name].alias or name, value


def _one_of(section: Section, names: tuple[str, ...]) -> Iterator[SectionProblem]:
    given = [key for key, _ in _given(section, names)]
    if len(given) != 1:
        fields = type(section).model_fields
        keys = ", ".join(fields[name].alias or name for name in names)
        yield (), f"needs exactly one of {keys}", ", ".join(given) or None
