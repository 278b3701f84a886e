"""Work that is done once per request: a long trajectory, a large file, a long program."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tools.bench.program import program_times

from robotd.control.groups.descriptor_limits import axis_limits, joint_limits, trajectory_rules
from robotd.descriptor import load_robot_descriptor
from robotd.motion import MotionState, TrajectoryRequest, plan
from robotd_wmx_parameters import default_wmx_parameters, read_wmx_parameters
from robotd_wmx_parameters.xml_file import write_wmx_parameters

POINTS = 1000
JOINTS = 6
FILE_BYTES = 1_000_000
REPETITIONS = 15


def planning(folder: Path) -> dict[str, float]:
    """Medians in ms, after a first time that imports and compiles what is needed."""
    path = folder / "parameters.xml"
    write_wmx_parameters(default_wmx_parameters(), path)
    if (padding := FILE_BYTES - path.stat().st_size) > 0:
        path.write_text(path.read_text() + f"<!--{'-+' * (padding // 2)}-->\n")
    return {
        "plan_1000x6_ms": _median_ms(_plan_call()),
        "parameters_128_axes_ms": _median_ms(lambda: read_wmx_parameters(path)),
        "parameters_file_mb": path.stat().st_size / 1e6,
        **program_times(folder),
    }


def _plan_call() -> Callable[[], Any]:
    descriptor = load_robot_descriptor("cr3a")
    limits = joint_limits(descriptor.joints, axis_limits(descriptor))
    rules = trajectory_rules(descriptor.trajectory, limits.units)
    times = np.linspace(0.02, 20.0, POINTS)
    phases = np.arange(JOINTS)
    grows = np.sin(np.pi * times[:, None] / times[-1]) ** 2  # at rest at both ends
    positions = 0.5 * grows * (np.sin(times[:, None] + phases) - np.sin(phases))
    rows = positions.tolist()
    start = MotionState.at_rest(np.zeros(JOINTS))
    names = limits.names

    def call() -> Any:
        request = TrajectoryRequest.from_rows(names, times.tolist(), rows)
        return plan(request, limits, rules, start)

    return call


def _median_ms(call: Callable[[], Any]) -> float:
    times = []
    call()
    for _ in range(REPETITIONS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1000.0
