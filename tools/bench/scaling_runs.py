"""Robots of any size, on their own or several at a time, and what running them costs."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from tools.bench.percentiles import percentiles
from tools.bench.process import Program, fresh_environment

from robotd.clock import NANOSECONDS
from robotd.clock.simulated import SteppedClock
from robotd.motion import TrajectoryRequest
from robotd.robot import open_robot
from robotd_testing.domain import own_domain

SETTLE_S = 1.5
HELD_PERCENT = 99.0  # of the deadlines: a rate that is held

AXES = (2, 6, 12, 24, 48, 128)
RATES_HZ = (100, 250, 500, 1000, 2000)
ROBOTS = (1, 2, 4, 8, 16)
PHYSICS_AXES = (6, 12, 24)
PHYSICS_ROUNDS = 2
ARM_JOINTS = "zyyyzy"  # axes of the joints of an arm with physics
SIMULATED_S = 5.0


@dataclass(frozen=True)
class Run:
    """``robots`` equal robots at a time, each in a process and a ROS domain of its own."""

    axes: int = 6
    rate_hz: int = 500
    robots: int = 1
    backend: str = "sim"


CROWD = Run(rate_hz=100, robots=32)  # at 500 Hz they need more than the two cores of the figures


def runs() -> Iterator[Run]:
    """Each of the three grows, the others stay: six axes, 500 Hz, one robot; then ``CROWD``."""
    yield from dict.fromkeys(
        [
            *(Run(axes=axes) for axes in AXES),
            *(Run(rate_hz=rate_hz) for rate_hz in RATES_HZ),
            *(Run(robots=robots) for robots in ROBOTS),
            CROWD,
        ]
    )


def physics_runs() -> Iterator[Run]:
    """Axes without and with physics, one after the other: both meet the same load of others."""
    for _ in range(PHYSICS_ROUNDS):
        for axes in PHYSICS_AXES:
            yield from (Run(axes=axes, backend=backend) for backend in ("sim", "mujoco"))


def measure(run: Run, seconds: float, folder: Path) -> dict[str, Any]:
    """The figures of a run; of several robots the mean, of their lateness the worst.

    CPU is user and system time of all threads of one robot, in percent of one core.
    """
    reports = [folder / f"report{number}.json" for number in range(run.robots)]
    with ExitStack() as stack:
        programs = []
        began_s = time.monotonic()
        for report in reports:
            programs.append(stack.enter_context(_robot(run, report, stack)))
            programs[-1].wait_output("ready after")  # one after the other: all at once take long
        start_s = (time.monotonic() - began_s) / run.robots
        time.sleep(SETTLE_S)
        begin_ns, used_s = time.monotonic_ns(), -np.array([program.cpu_s() for program in programs])
        time.sleep(seconds)
        end_ns = time.monotonic_ns()
        used_s += [program.cpu_s() for program in programs]
        memory = [program.memory_mib() for program in programs]
    timing = [_timing(report, (begin_ns, end_ns), run.rate_hz) for report in reports]
    return {
        **asdict(run),
        "start_s": start_s,
        "cpu_percent": float(np.mean(used_s)) / ((end_ns - begin_ns) * 1e-9) * 100.0,
        **{key: float(np.mean([row[key] for row in memory])) for key in memory[0]},
        **{key: max(row[key] for row in timing) for key in timing[0] if key != "met_percent"},
        "met_percent": min(row["met_percent"] for row in timing),
        "times_real_time": _times_real_time(reports[0].with_suffix(".yaml"), run.backend),
    }


def _times_real_time(file: Path, backend: str) -> float:
    """Return how many seconds pass for a moving robot in one, in stepped time."""
    clock = SteppedClock()
    with open_robot(file, backend, clock=clock) as robot:
        names, goal = robot.joint_names, [[0.3] * len(robot.joint_names)]
        request = TrajectoryRequest.from_rows(names, [SIMULATED_S], goal)
        began_s = time.perf_counter()
        with robot.follower.follow(request):
            clock.sleep_until_ns(clock.now_ns() + round(SIMULATED_S * NANOSECONDS))
        return SIMULATED_S / (time.perf_counter() - began_s)


def holds(figures: dict[str, Any]) -> bool:
    """Return True if the rate is held."""
    return bool(figures["met_percent"] >= HELD_PERCENT)


def _robot(run: Run, report: Path, stack: ExitStack) -> Program:
    file = report.with_suffix(".yaml")
    file.write_text(json.dumps(_descriptor(run)), encoding="utf-8")  # JSON is YAML
    file.with_name("arms.urdf").write_text(_urdf(run.axes), encoding="utf-8")
    command = [
        *(sys.executable, "-m", "robotd", "--robot", str(file), "--backend", run.backend),
        *("--report", str(report), "--log-level", "warning"),
    ]
    return Program(command, fresh_environment(stack.enter_context(own_domain())))


def _descriptor(run: Run) -> dict[str, Any]:
    limits = {"lower_rad": -3, "upper_rad": 3, "velocity_rad_s": 3, "acceleration_rad_s2": 12}
    names = [f"joint{axis + 1}" for axis in range(run.axes)]
    services = ["engine", "core_motion", "io", "ethercat"]
    return {
        "schema": 1,
        "name": "scaling",
        "cycle": {"rate_hz": run.rate_hz},
        "joints": [{"name": name, "axis": axis, **limits} for axis, name in enumerate(names)],
        **({"urdf": "arms.urdf"} if run.backend == "mujoco" else {}),
        "nodes": [*(f"wmx_{name}_node" for name in services), "manipulator_state"],
        "ros_parameters": {
            "manipulator_state": {
                "encoder_joint_topic": "joint_states",
            }
        },
    }


def _urdf(axes: int) -> str:
    """Return arms of up to six joints, side by side."""
    robot = etree.Element("robot", name="arms")
    etree.SubElement(robot, "link", name="base")
    for axis in range(axes):
        arm, number = divmod(axis, len(ARM_JOINTS))
        name, kind = f"joint{axis + 1}", ARM_JOINTS[number]
        link = etree.SubElement(robot, "link", name=f"link{axis + 1}")
        inertial = etree.SubElement(link, "inertial")
        etree.SubElement(inertial, "origin", xyz="0 0 0.08")
        etree.SubElement(inertial, "mass", value="1")
        moments = dict.fromkeys(("ixx", "iyy", "izz"), "0.003")
        etree.SubElement(inertial, "inertia", moments, ixy="0", ixz="0", iyz="0")
        collision = etree.SubElement(link, "collision")
        etree.SubElement(collision, "origin", xyz="0 0 0.08")
        shape = etree.SubElement(collision, "geometry")
        etree.SubElement(shape, "cylinder", radius="0.03", length="0.1")
        joint = etree.SubElement(robot, "joint", name=name, type="revolute")
        etree.SubElement(joint, "parent", link=f"link{axis}" if number else "base")
        etree.SubElement(joint, "child", link=f"link{axis + 1}")
        etree.SubElement(joint, "origin", xyz="0 0 0.16" if number else f"{2 * arm} 0 0")
        etree.SubElement(joint, "axis", xyz={"z": "0 0 1", "y": "0 1 0"}[kind])
        etree.SubElement(joint, "limit", lower="-3", upper="3", velocity="3", effort="100")
    return etree.tostring(robot, encoding="unicode")


def _timing(report: Path, window: tuple[int, int], rate_hz: int) -> dict[str, float]:
    """Periods in the window as the robot recorded them, at most 8192."""
    samples = json.loads(report.read_text(encoding="utf-8"))["samples"]
    start = np.array(samples["start_ns"])
    lateness_us = np.array(samples["lateness_ns"])[(start >= window[0]) & (start < window[1])] / 1e3
    missed = float((lateness_us * rate_hz // 1e6).sum())
    kept = len(lateness_us)
    return {
        **percentiles("lateness", lateness_us),
        "met_percent": 100.0 * kept / (kept + missed) if kept else 0.0,
        "missed": missed,
    }
