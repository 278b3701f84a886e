"""``python -m tools.bench.twist``: lag, path error and cost of tool streams at 500 Hz.

The stage and the setpoint limiter behind it run as in the control loop, without the loop.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np

from robotd.api import FloatArray, read_urdf
from robotd.api.robots import JointLimits, MotionLimits
from robotd.motion import MotionState
from robotd.motion.limiter import SetpointLimiter
from robotd_tool_space import Kinematics
from robotd_tool_space.geometry.rotations import pose_differences
from robotd_tool_space.streams.twist import ToolTwist, TwistStage

URDF = Path(__file__).parents[2] / "robots/cr3a/cr3a.urdf"
PERIOD_S = 0.002
READY = np.array([0.3, -0.6, 1.6, -0.3, 1.2, 0.0])
Commands = Mapping[float, ToolTwist]


@click.command()
def main() -> None:
    """Measure the twist stage on cr3a, whose joints have 2.8 rad/s and 12.5 rad/s²."""
    urdf = read_urdf(URDF)
    names = [f"joint{number}" for number in range(1, 7)]
    arm = Kinematics.of_urdf(urdf, names, "link6")
    limits = JointLimits(arm.chain.names, arm.lower, arm.upper, np.full(6, 2.8), np.full(6, 12.5))
    click.echo(
        "motion                      v/vmax  a/amax  off the line              behind reference"
        "  CPU p50/p99"
    )
    for name, (start, commands, seconds) in _motions(arm).items():
        click.echo(f"{name:26}{_measure(arm, limits, start, commands, seconds)}")


def _motions(arm: Kinematics) -> dict[str, tuple[FloatArray, Commands, float]]:
    out = arm.forward(READY)[:3, 3] * [1.0, 1.0, 0.0]
    out = 0.15 * out / np.linalg.norm(out)
    wrist = READY.copy()
    wrist[4] = 0.9
    random = np.random.default_rng(0)
    joystick = {
        0.25 * index: ToolTwist(
            np.concatenate([random.uniform(-0.2, 0.2, 3), random.uniform(-0.6, 0.6, 3)])
        )
        for index in range(16)
    }
    return {
        "to the stretch, 0.15 m/s": (READY, {0.0: _linear(out), 3.0: _linear(-out)}, 5.0),
        "over the shoulder, 0.15 m/s": (READY, {0.0: _linear(-out), 3.0: _linear(out)}, 5.0),
        "wrist, 0.8 rad/s": (wrist, {0.0: ToolTwist(np.array([0, 0, 0, 0, 0.8, 0.0]))}, 3.0),
        "to the stretch, 0.25 m/s": (READY, {0.0: _linear(out / 0.6)}, 3.0),
        "over the shoulder, 0.25 m/s": (READY, {0.0: _linear(-out / 0.6)}, 3.0),
        "to the stretch, 0.5 m/s": (READY, {0.0: _linear(out / 0.3)}, 3.0),
        "over the shoulder, 0.5 m/s": (READY, {0.0: _linear(-out / 0.3)}, 3.0),
        "joystick steps": (READY, joystick, 4.0),
    }


def _linear(velocity: FloatArray) -> ToolTwist:
    return ToolTwist(np.concatenate([velocity, np.zeros(3)]))


def _measure(
    arm: Kinematics, limits: JointLimits, start: FloatArray, commands: Commands, seconds: float
) -> str:
    rest = np.zeros(6)
    stage, limiter = TwistStage(lambda: arm, MotionLimits()), SetpointLimiter(limits, PERIOD_S)
    stage.begin(np.array([start, rest, rest]), limits, PERIOD_S)
    limiter.reset(MotionState(start, rest, rest))
    due = {round(at / PERIOD_S): command for at, command in commands.items()}
    references, setpoints, path, cost = [], [], [], []
    for period in range(round(seconds / PERIOD_S)):
        before = time.thread_time()
        if period in due:
            stage.take(due[period])
        reference = stage.advance()
        setpoint = limiter.track(reference, reference[0].tolist(), [False] * 6)
        cost.append(1e6 * (time.thread_time() - before))
        references.append(reference)
        setpoints.append(setpoint.copy())
        path.append(stage.pose)
    reference, setpoint = np.array(references), np.array(setpoints)
    reached = arm.forward(setpoint[:, 0])
    differences = pose_differences(reached, np.array(path))
    off = 1e6 * np.linalg.norm(differences[:, :3], axis=1).max()
    turned = 1e3 * np.linalg.norm(differences[:, 3:], axis=1).max()
    deviation = reached[:, :3, 3] - arm.forward(reference[:, 0])[:, :3, 3]
    behind = 1e6 * np.linalg.norm(deviation, axis=1).max()
    fast = np.abs(reference[:, 1] / limits.velocity).max()
    strong = np.abs(reference[:, 2] / limits.acceleration).max()
    p50, p99 = np.percentile(cost, [50, 99])
    path_error = f"{off:9.1f} µm {turned:.3f} mrad{behind:15.1f} µm"
    return f"{fast:8.2f}{strong:8.2f}{path_error}{p50:9.0f} / {p99:.0f} µs"


if __name__ == "__main__":
    main()
