"""Scenario files: model and loader, commands and checks step by step, and what a check finds."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from robotd.api import ConnectionState, Operation
from robotd.api.models import RobotDescriptor, beside, read_yaml, validate
from robotd.api.robots import Robot
from robotd_scenario.fault_kinds import AxisNumber, Fault, Finite, Part, Seconds

Axes = tuple[AxisNumber, ...]
STANDSTILL = 1e-2  # rad/s or m/s


class Expected(StrEnum):
    """Expected outcome of a command."""

    OK = "ok"
    REJECTED = "rejected"
    PATH_TOLERANCE = "path_tolerance"
    GOAL_TOLERANCE = "goal_tolerance"
    FAULT = "fault"


class Switch(StrEnum):
    """State of a servo or of the communication."""

    ON = "on"
    OFF = "off"


class Fingers(StrEnum):
    """State of the gripper."""

    OPEN = "open"
    CLOSED = "closed"


class MoveStep(Part):
    """Motion of joints to positions in ``time_s``; joints not named hold."""

    to_rad: dict[str, Finite] = Field(min_length=1)
    time_s: Seconds


class Point(Part):
    """A point of a trajectory."""

    at_s: Seconds
    positions_rad: tuple[Finite, ...]


class TrajectoryStep(Part):
    """Trajectory as a client sends it."""

    joints: tuple[str, ...] = Field(min_length=1)
    points: tuple[Point, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        for number, point in enumerate(self.points):
            if len(point.positions_rad) != len(self.joints):
                raise ValueError(
                    f"point {number} has {len(point.positions_rad)} positions for"
                    f" {len(self.joints)} joints"
                )
        return self


class Check(Part):
    """Expectations that must hold, now or within ``within_s``; absent ones are not checked.

    Attributes:
        joints_rad: measured positions, to ``tolerance_rad``.
        servos_on, alarms, offline: exactly these axes, and no others.
        gripper: the fingers have arrived there.
        standstill: no axis executes a command, and none moves.
    """

    within_s: float = Field(0.0, ge=0, le=3600)
    joints_rad: dict[str, Finite] | None = None
    tolerance_rad: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1e-3
    engine: ConnectionState | None = None
    servos_on: Axes | None = None
    alarms: Axes | None = None
    offline: Axes | None = None
    gripper: Fingers | None = None
    standstill: bool | None = None

    @model_validator(mode="after")
    def _checks_something(self) -> Self:
        conditions = self.model_dump(exclude_none=True, exclude={"within_s", "tolerance_rad"})
        if not conditions:
            raise ValueError("has no condition")
        return self


class RepeatedSteps(Part):
    """Repeated steps."""

    times: int = Field(ge=1, le=100_000)
    program: tuple[ScenarioStep, ...] = Field(min_length=1)


class ScenarioStep(Part):
    """One step: exactly one command, and its expected outcome.

    Attributes:
        wait_s: let simulated time pass.
        servos: all joints and wheels; alarms are cleared before they are switched on.
        engine: the whole start-up, or the stop of communication.
        expect: outcome of the command; ``reason`` is part of its text.
    """

    move: MoveStep | None = None
    trajectory: TrajectoryStep | None = None
    gripper: Fingers | None = None
    wait_s: Seconds | None = None
    servos: Switch | None = None
    engine: Switch | None = None
    check: Check | None = None
    repeat: RepeatedSteps | None = None
    expect: Expected = Expected.OK
    reason: str = ""

    @model_validator(mode="after")
    def _one_command(self) -> Self:
        given = [name for name in COMMANDS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"needs exactly one of {', '.join(COMMANDS)}")
        if given[0] in ("wait_s", "check", "repeat") and (
            self.expect is not Expected.OK or self.reason
        ):
            raise ValueError(f"expect and reason do not go with {given[0]}")
        return self

    def __str__(self) -> str:
        if self.move:
            targets = " ".join(f"{name}={value:g}" for name, value in self.move.to_rad.items())
            return f"move {targets} in {self.move.time_s:g} s"
        if self.trajectory:
            return f"trajectory of {len(self.trajectory.points)} points"
        if self.check:
            values = self.check.model_dump(mode="json", exclude_unset=True)
            return "check " + " ".join(f"{key}={value}" for key, value in values.items())
        name = next(name for name in COMMANDS if getattr(self, name) is not None)
        return f"{name.removesuffix('_s')} {getattr(self, name)}"


COMMANDS = tuple(name for name in ScenarioStep.model_fields if name not in ("expect", "reason"))


def unmet(check: Check, robot: Robot) -> str | None:
    """Describe the unmet expectations with the actual values; None: all are met."""
    return "; ".join(_findings(check, robot)) or None


def standing(robot: Robot) -> bool:
    """Return True while no axis executes a command and none moves."""
    image = robot.image
    idle = bool((image.operation == Operation.IDLE).all())
    return idle and not bool((np.abs(image.velocity) > STANDSTILL).any())


def _findings(check: Check, robot: Robot) -> Iterator[str]:
    for name, wanted in (check.joints_rad or {}).items():
        yield from _joint(robot, name, wanted, check.tolerance_rad)
    if check.engine not in (None, state := robot.connection.state):
        yield f"engine is {state.value}"
    image = robot.image
    for name, axes, flags in (
        ("servos on", check.servos_on, image.servo_on),
        ("alarms", check.alarms, image.amp_alarm),
        ("offline", check.offline, image.offline),
    ):
        yield from _axes(name, axes, flags)
    if check.standstill not in (None, now := standing(robot)):
        yield "all axes stand" if now else "an axis moves"
    if check.gripper is not None:
        yield from _gripper(robot, check.gripper)


def _joint(robot: Robot, name: str, wanted: float, tolerance: float) -> Iterator[str]:
    if name not in robot.joint_names:
        yield f"unknown joint {name!r}"
        return
    position = float(robot.image.position[robot.joint_axes[robot.joint_names.index(name)]])
    if not abs(position - wanted) <= tolerance:
        shown = round(position, 6) + 0.0  # no -0
        yield f"{name} is at {shown:.6f} rad, not within {tolerance:g} of {wanted:g}"


def _axes(what: str, wanted: Axes | None, flags: np.ndarray) -> Iterator[str]:
    present = np.flatnonzero(flags).tolist()
    if wanted is not None and sorted(wanted) != present:
        yield f"{what}: {present or 'none'}"


def _gripper(robot: Robot, wanted: Fingers) -> Iterator[str]:
    if robot.gripper is None:
        yield f"{robot.descriptor.name} has no gripper"
        return
    closed = robot.gripper.closed
    if closed != (1.0 if wanted is Fingers.CLOSED else 0.0):
        yield f"gripper is {closed:.0%} closed"


class Scenario(Part):
    """Faults, commands and checks for one robot.

    Attributes:
        robot: a name, or a path relative to the file; None takes it from elsewhere.
        options: laid over the backend's section of the descriptor (``seed``, noise ...).
        faults: injected faults; times count from the moment that the robot is ready.
        program: commands and checks; used by ``robotd sim run`` only.
    """

    schema_: Literal[1] = Field(alias="schema")
    summary: str = ""
    robot: str | None = None
    variant: str | None = None
    backend: str = "sim"
    options: dict[str, Any] = Field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    program: tuple[ScenarioStep, ...] = ()
    _tree: Any = PrivateAttr(None)  # of the file; None for a scenario of a program

    def lay_over(self, descriptor: RobotDescriptor) -> RobotDescriptor:
        """Return ``descriptor`` with the options of this scenario."""
        if not self.options:
            return descriptor
        origin = self._tree.find(("options",)) if self._tree else None
        return descriptor.with_options(self.backend, self.options, origin)


def load_scenario(path: Path) -> Scenario:
    """Read and check a file. Raises DescriptorError with every error and its line."""
    tree = read_yaml(path)
    scenario = validate(Scenario, tree.plain(), tree)
    scenario._tree = tree  # noqa: SLF001 - the file is read here alone
    robot = scenario.robot
    if robot is None or not (robot.endswith(".yaml") or "/" in robot):
        return scenario
    return scenario.model_copy(update={"robot": str(beside(path, robot))})
