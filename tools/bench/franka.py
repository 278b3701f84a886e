"""Rates, latencies and errors of the backend franka on a controller, simulated or real.

``python -m tools.bench.franka ADDRESS``: the arm moves by 0.3 rad, and back. Prints a table: age of
the states, periods of the control loop, time from a target to the motion, and errors of the joints.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

from robotd import Robot, open_robot
from robotd.api import FloatArray
from robotd.api.robots import TrajectoryRequest

REST_S = 3.0
TRAVEL_RAD = np.array([0.3, 0.2, -0.2, 0.2, 0.3, -0.2, 0.3])
TRAVEL_S = 2.0
NOTICEABLE_RAD = 0.0005


def measure(robot: Robot) -> dict[str, str]:
    """Return the rows of the table."""
    rows: dict[str, str] = {}
    ages, periods, last_ns = [], [], 0
    began_s = time.perf_counter()
    while time.perf_counter() - began_s < REST_S:
        image = robot.image.copy()
        if image.stamp_ns != last_ns:
            ages.append((image.stamp_ns - image.fresh_ns) * 1e-6)
            periods.append((image.stamp_ns - last_ns) * 1e-6)
            last_ns = image.stamp_ns
        time.sleep(0.0002)
    rows["age of a state when the control loop takes it"] = spread(ages)
    rows["period of the control loop at rest"] = spread(periods[1:])
    start = robot.image.copy().position
    followed: list[FloatArray] = []
    for target in (start + TRAVEL_RAD, start):
        began, errors = follow(robot, target)
        followed.append(errors)
        rows["time from the first target to motion"] = f"{began * 1e3:.0f} ms"
    rows["following error, largest of each joint"] = numbers(np.maximum(*followed))
    time.sleep(0.5)
    image = robot.image.copy()
    rows["error at rest of each joint"] = numbers(np.abs(image.position - image.position_command))
    return rows


def follow(robot: Robot, target: FloatArray) -> tuple[float, FloatArray]:
    """Follow a goal; return the delay of the motion, s, and the largest error of each joint."""
    names = robot.joint_names
    request = TrajectoryRequest.from_rows(names, [TRAVEL_S], [target.tolist()])
    start = robot.image.copy()
    commanded_ns = moved_ns = 0
    errors = np.zeros(len(names))
    with robot.follower.follow(request) as execution:
        ends_s = time.perf_counter() + TRAVEL_S
        while time.perf_counter() < ends_s:
            image = robot.image.copy()
            errors = np.maximum(errors, np.abs(image.position - image.position_command))
            away = np.abs(image.position_command - start.position_command).max()
            commanded_ns = commanded_ns or (away > NOTICEABLE_RAD) * image.stamp_ns
            away = np.abs(image.position - start.position).max()
            moved_ns = moved_ns or (away > NOTICEABLE_RAD) * image.stamp_ns
            time.sleep(0.0005)
        execution.wait(30.0)
    return (moved_ns - commanded_ns) * 1e-9, errors


def spread(values_ms: list[float]) -> str:
    """Return median, 99 % and maximum."""
    middle, high = np.percentile(values_ms, [50, 99])
    return f"{middle:.2f} ms, 99 %: {high:.2f} ms, at most {max(values_ms):.1f} ms"


def numbers(values: FloatArray) -> str:
    return ", ".join(f"{value * 1e3:.1f}" for value in values) + " mrad"


def main(address: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "robot.yaml")
        section = {"franka": {"address": address}}
        arm = {"schema": 1, "name": "arm", "extends": "fr3", "backend": "franka"}
        file.write_text(yaml.safe_dump(arm | {"backends": section}), encoding="utf-8")
        with open_robot(file) as robot:
            for name, value in measure(robot).items():
                print(f"| {name} | {value} |")


if __name__ == "__main__":
    main(sys.argv[1])
