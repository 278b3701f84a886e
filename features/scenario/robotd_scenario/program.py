"""Commands and checks of a scenario, step by step."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, model_validator

from robotd.api import ConnectionState
from robotd_scenario.fault_kinds import AxisNumber, Finite, Part, Seconds

Axes = tuple[AxisNumber, ...]


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


class Move(Part):
    """Motion of joints to positions in ``time_s``; joints not named hold."""

    to_rad: dict[str, Finite] = Field(min_length=1)
    time_s: Seconds


class Point(Part):
    """A point of a trajectory."""

    at_s: Seconds
    positions_rad: tuple[Finite, ...]


class Trajectory(Part):
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


class Repeat(Part):
    """Repeated steps."""

    times: int = Field(ge=1, le=100_000)
    program: tuple[Step, ...] = Field(min_length=1)


class Step(Part):
    """One step: exactly one command, and its expected outcome.

    Attributes:
        wait_s: let simulated time pass.
        servos: all joints and wheels; alarms are cleared before they are switched on.
        engine: the whole start-up, or the stop of communication.
        expect: outcome of the command; ``reason`` is part of its text.
    """

    move: Move | None = None
    trajectory: Trajectory | None = None
    gripper: Fingers | None = None
    wait_s: Seconds | None = None
    servos: Switch | None = None
    engine: Switch | None = None
    check: Check | None = None
    repeat: Repeat | None = None
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


COMMANDS = tuple(name for name in Step.model_fields if name not in ("expect", "reason"))
