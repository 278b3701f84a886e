"""Robots on the stand-in's engine, without ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yaml

from robotd.clock import MonotonicClock, wait_until
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, open_robot

ROBOTS = Path(__file__).resolve().parents[3] / "robots"
JOINTS = tuple(f"joint{number}" for number in range(1, 7))


def descriptor(folder: Path, name: str = "cr3a", **wmx: object) -> Path:
    """A copy of a robot's descriptor with options of this backend."""
    data = yaml.safe_load((ROBOTS / name / "robot.yaml").read_text("utf-8"))
    # The stand-in's engine is an ordinary process, which a busy computer keeps waiting.
    patience = {"open_tries": 1, "shutdown_s": 3.0, "stale_after_s": 5.0}
    data["engine"] = {**data.get("engine", {}), **patience}
    data["backends"] = {"wmx": {"stream_buffer_s": 0.03, **wmx}}
    for key in ("parameters_file", "urdf"):
        if key in data:
            data[key] = str(ROBOTS / name / data[key])
    path = folder / f"{name}{len(list(folder.iterdir()))}.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


@contextmanager
def running(
    folder: Path, name: str = "cr3a", *, enable: bool = True, **wmx: object
) -> Iterator[Robot]:
    with open_robot(descriptor(folder, name, **wmx), "wmx", enable=enable) as robot:
        yield robot


def eventually(condition: Callable[[], bool], timeout_s: float = 30.0) -> None:
    assert wait_until(condition, timeout_s, MonotonicClock())


def goal(times_s: Sequence[float], *points: float) -> TrajectoryRequest:
    """All six joints through the same positions."""
    rows = np.repeat(np.array(points)[:, None], 6, axis=1)
    return TrajectoryRequest(JOINTS, np.array(times_s), rows)
