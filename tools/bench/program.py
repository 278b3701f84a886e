"""A program of 200 steps: its check, and how soon it moves the arm."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import numpy as np

from robotd import OperationError, open_robot
from robotd.api.robots import SteppedClock
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

ROUNDS = 20  # of ten steps; each leads to other places: nothing is known from the one before
ROUND = """
  - move: {joints: {joint1: AT, joint2: 0.3, joint3: 1.4, joint4: -0.2, joint5: 1.2, joint6: 0.0}}
  - line: {by: {z: -0.05}, speed: 0.3}
  - gripper: close
  - line: {by: {z: 0.05}}
  - line: {by: {y: 0.04, z: 0.01}}
  - arc: {via: {by: {y: 0.03, z: 0.03}}, to: {by: {z: 0.06}}}
  - path: {through: [{by: {y: -0.05}}, {by: {z: -0.05}}, {by: {x: 0.03}}], blend_m: 0.01}
  - line: {by: {x: -0.02, yaw: 0.2}}
  - output: {name: 0.1, on: true}
  - move: {by: {z: 0.03}}
"""
GUARDED = """
extends: cr3a
name: arm
tool_space:
  collisions: {planes: {floor: {normal: [0, 0, 1], distance_m: 0.0}}}
"""
REPETITIONS = 5


def program_times(folder: Path) -> dict[str, float]:
    """Medians in ms: check of the whole program, and from its run to motion, checked before."""
    steps = [ROUND.replace("AT", f"{0.04 * number - 0.5:.2f}") for number in range(ROUNDS)]
    file = folder / "robot.yaml"
    file.write_text(GUARDED, encoding="utf-8")
    checks, starts = [], []
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        programs = robot.feature(Programs)

        def on_tick() -> None:
            if np.abs(robot.image.velocity).max() > 0.0:
                raise OperationError("it moves")

        for number in range(REPETITIONS + 1):
            # Another text: one that has passed is not checked again.
            text = "".join([f"# {number}\nspeed: 0.5\nsteps:", *steps])
            begin_s = time.perf_counter()
            program = Program.parse(text)
            programs.check(program)
            checked_s = time.perf_counter()
            with suppress(OperationError):
                programs.run(program, on_tick)
            checks.append(checked_s - begin_s)
            starts.append(time.perf_counter() - checked_s)
    return {  # without the first, which imports and computes once what is needed
        "program_200_steps_check_ms": 1000.0 * float(np.median(checks[1:])),
        "program_200_steps_start_ms": 1000.0 * float(np.median(starts[1:])),
    }
