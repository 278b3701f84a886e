"""Subjects of the comparison: the daemon in three states, and three publishers."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

from tools.bench.c_program import CProgram
from tools.bench.process import Program, fresh_environment

from robotd.descriptor import load_robot_descriptor

ROBOT = "cr3a"


class Load(Enum):
    """Load by a client in another process."""

    NONE = "at rest"
    MOVING = "a trajectory runs"
    BUSY = "a trajectory runs, 200 services/s"


@dataclass(frozen=True)
class Subject:
    """One program at one rate.

    Attributes:
        service: a std_srvs/Trigger that answers from memory.
        report: file with its own timing after it ended; None where it writes none.
        prints_report: its own timing is its output instead.
        ready: in its output when it is up; "" to go by the first message.
    """

    name: str
    rate_hz: int
    command: list[str]
    service: str
    report: Path | None = None
    prints_report: bool = False
    ready: str = ""
    load: Load = Load.NONE
    environment: dict[str, str] = field(default_factory=dict)

    def program(self, domain: int) -> Program:
        return Program(self.command, fresh_environment(domain) | self.environment)

    def samples(self, program: Program) -> dict[str, Any] | None:
        """Its own timing, period by period, after it ended; None where it keeps none."""
        if self.report is None and not self.prints_report:
            return None
        text = self.report.read_text() if self.report else program.output
        samples: dict[str, Any] = json.loads(text)["samples"]
        return samples


def subjects(c_program: CProgram | None, folder: Path) -> Iterator[Subject]:
    """All of them, those that are compared side by side in time."""
    for rate_hz in (500, 1000):
        yield daemon(rate_hz, Load.NONE, folder)
        if c_program is not None:
            yield c_subject(c_program, rate_hz)
        if rate_hz == 500:
            yield _python("thread", rate_hz)
            yield _python("timer", rate_hz)
        yield daemon(rate_hz, Load.MOVING, folder)
        yield daemon(rate_hz, Load.BUSY, folder)


def daemon(rate_hz: int, load: Load, folder: Path, python: str = sys.executable) -> Subject:
    """Return robotd, by the interpreter ``python`` of its checkout."""
    name = f"robotd-{rate_hz}" + ("" if load is Load.NONE else f"-{load.name.lower()}")
    report = folder / f"{name}.json"
    return Subject(
        name,
        rate_hz,
        [
            *(python, "-m", "robotd", "--robot", ROBOT, "--backend", "sim"),
            *("--rate", str(rate_hz), "--report", str(report)),
            *("--ros-args", "-p", f"manipulator_state:joint_feedback_rate:={rate_hz}"),
        ],
        "/wmx/engine/get_status",
        report,
        ready="ready after",
        load=load,
    )


def c_subject(program: CProgram, rate_hz: int) -> Subject:
    """Return the C program."""
    priority = load_robot_descriptor(ROBOT).cycle.realtime_priority
    return Subject(
        f"c-{rate_hz}",
        rate_hz,
        [*program.command, str(rate_hz), str(priority)],
        "/baseline/trigger",
        prints_report=True,
        environment=program.environment,
    )


def _python(kind: str, rate_hz: int) -> Subject:
    command = [sys.executable, "-m", "tools.bench.publishers", kind, str(rate_hz)]
    return Subject(f"rclpy-{kind}-{rate_hz}", rate_hz, command, "/baseline/trigger")
