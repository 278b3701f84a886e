"""Joints whose limits exclude 0, and joints outside their limits, on each simulated backend."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from robotd.clock import MonotonicClock, wait_until
from robotd.control.groups.problem import ProblemKind
from robotd.descriptor import load_robot_descriptor
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_ethercat.bus_namespace import missing_rights
from robotd_ros.diagnostics.part_status import DiagnosticLevel
from robotd_ros.diagnostics.robot_health import Health

RANGES = ((-2.0, 2.0), (-3.0, -1.0), (0.5, 1.5), (-1.0, 1.0), (0.0, 2.0), (-1.5, -0.1))
INITIAL = (0.0, -1.2, 0.6, 0.0, 0.2, -0.24)  # a tenth of the range inside


@pytest.fixture(params=["sim", "canopen", "ethercat"])
def backend(request: pytest.FixtureRequest) -> str:
    name = str(request.param)
    if name == "ethercat" and (reason := missing_rights()):
        pytest.skip(reason)
    return name


@contextmanager
def cr3a(backend: str) -> Iterator[Robot]:
    """CR3A with ``RANGES`` as its limits, not started."""
    variant = None if backend == "sim" else f"{backend}_simulated"
    descriptor = load_robot_descriptor("cr3a", variant)
    joints = tuple(
        joint.model_copy(update={"lower_rad": lower, "upper_rad": upper})
        for joint, (lower, upper) in zip(descriptor.joints, RANGES, strict=True)
    )
    engine = descriptor.engine.model_copy(update={"stale_after_s": 1.0})
    descriptor = descriptor.model_copy(
        update={"joints": joints, "engine": engine, "parameters_file": None}
    )
    robot = Robot(descriptor, load_backend(backend), MonotonicClock())
    try:
        yield robot
    finally:
        robot.shutdown()


def outside(robot: Robot) -> list[str]:
    return [
        problem.text
        for problem in robot.find_problems()
        if problem.kind is ProblemKind.OUTSIDE_LIMITS
    ]


def test_simulated_joints_begin_inside_their_limits(backend: str) -> None:
    with cr3a(backend) as robot:
        robot.start()
        assert robot.image.copy().position == pytest.approx(INITIAL, abs=1e-3)
        assert robot.problems == []
        targets = [start + 0.05 for start in INITIAL]
        goal = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [targets])
        with robot.follower.follow(goal) as execution:
            assert execution.wait(20.0), "the goal does not end"
        assert robot.image.copy().position == pytest.approx(targets, abs=0.01)


def test_a_joint_outside_its_limits_is_a_problem_until_it_is_back(backend: str) -> None:
    with cr3a(backend) as robot:
        limits = list(robot.axes.limits)
        limits[1] = replace(limits[1], lower=-3.0, upper=-1.3)
        limits[4] = replace(limits[4], lower=0.1995, upper=2.0)
        robot.axes.limits = tuple(limits)
        robot.start()
        assert outside(robot) == ["joint2: at -1.2 rad, outside its limits -3 to -1.3 rad"]
        status = {status.part: status for status in Health(robot).statuses()}["joint2"]
        assert (status.level, status.message) == (
            DiagnosticLevel.WARN,
            "at -1.2 rad, outside its limits -3 to -1.3 rad",
        )
        goal = TrajectoryRequest.from_rows(robot.joint_names, [1.0], [[0.0, -1.4, *INITIAL[2:]]])
        with robot.follower.follow(goal) as execution:
            assert execution.wait(20.0), "the goal does not end"
        assert wait_until(lambda: not outside(robot), 5.0, robot.clock)
