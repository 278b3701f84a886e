"""``python -m tools.endurance.stalls``: stop a robot's process for moments and judge its motors.

The robot runs in a child process. It is stopped by SIGSTOP at random points of the control
period while its joints swing; the motors are recorded tick by tick by the simulated device.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from tools.endurance.stalled_robot import SWING_RAD

from robotd.arrays import FloatArray
from robotd.descriptor import RobotDescriptor, load_robot_descriptor

BLEND_SHARE = 0.1  # of the velocity limit: highest speed relative to the path, as decision 8 says
ROUNDING = 1.05  # of the motors, which follow their commands with a lag
REVERSAL_SHARE = 0.02  # of the velocity limit
MOVING = 1e-3  # of the velocity limit; a slower path counts as ended
GAP_S = (0.05, 0.2)  # between two stalls
LEAVING_NS = 300_000_000  # after a goal that failed
HELD_NS = 120_000_000  # after a stall; a device that holds has seen it by then, and stops dead
STALLED_PERIODS = 1.5  # between two values; the computer stalls by itself, too
SILENT_PERIODS = 3  # without values while the robot's process runs: the device stalls
TICK_S = 0.001
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Verdict:
    """Extremes of the motors over all ticks; rad, s.

    Attributes:
        fastest: along the path's direction.
        backward: largest velocity against the direction of a path that moves, positive.
        beyond_path: velocity beyond the range of the path's velocities since the longest stall,
            in shares of the joint's velocity limit.
        acceleration: largest change of velocity over a control period, per second.
        overshoot: largest distance beyond the ends of the swing, from where the joint returns.
        reversals, leaps, jerks: numbers of events beyond the limits.
        silences: times at which the device's own process stalled. It then gets the setpoints of all
            that time at once; these moments are not judged.
    """

    stalls: int
    goals: int
    failures: list[str]
    missed: int
    path_velocity: float
    fastest: float
    backward: float
    beyond_path: float
    acceleration: float
    overshoot: float
    reversals: int
    leaps: int
    jerks: int
    silences: int


def judge(
    stalls: int,
    longest_s: float,
    robot: RobotDescriptor,
    data: dict[str, np.ndarray],
) -> Verdict:
    """Compare the motors' ticks in ``data`` with the path, joint 1 standing for all."""
    joint = robot.joints[0]
    times_ns, positions = data["times_ns"], data["positions"][:, 0]
    velocity = np.gradient(positions, TICK_S)
    window = round((longest_s + 0.03) / TICK_S)
    path = path_on(times_ns, data["path_times_ns"], data["path_velocities"])
    padded = np.concatenate([np.zeros(window), path, np.zeros(5)])
    seen = sliding_window_view(padded, window + 6)
    low, high = seen.min(1)[: len(path)], seen.max(1)[: len(path)]
    # A device stops dead in a stall, and is judged by how it goes on.
    low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
    beyond = np.maximum(velocity - high, low - velocity) / joint.velocity
    against = np.where(low >= 0.0, -velocity, np.where(high <= 0.0, velocity, 0.0))
    against[np.abs(path) <= MOVING * joint.velocity] = 0.0  # a joint beyond the end returns to it
    # A goal that failed was stopped, by the device's watchdog or the core.
    beyond[between(times_ns, data["failed_ns"], LEAVING_NS)] = 0.0
    period_s = 1.0 / robot.cycle.rate_hz
    periods = round(period_s / TICK_S)
    before, after = velocity[:-periods], velocity[periods:]
    change = np.abs(after - before) / (periods * TICK_S)
    stopped = between(times_ns[:-periods], all_stalls_ns(data, period_s), HELD_NS)
    change[stopped & (np.abs(after) < np.abs(before))] = 0.0
    silences_ns = all_silences_ns(data, period_s)
    silent = between(times_ns, silences_ns, LEAVING_NS)
    beyond[silent] = against[silent] = change[silent[periods:]] = 0.0
    return Verdict(
        stalls,
        int(data["goals"]),
        data["failures"].tolist(),
        int(data["missed"]),
        float(np.abs(path).max()),
        float(np.abs(velocity).max()),
        float(against.max()),
        float(beyond.max()),
        float(change.max()),
        float(max(-positions.min(), positions.max() - SWING_RAD)),
        runs(against > REVERSAL_SHARE * joint.velocity),
        runs(beyond > ROUNDING * BLEND_SHARE),
        runs(change > 2 * joint.acceleration),
        len(silences_ns),
    )


def path_on(times_ns: np.ndarray, path_ns: np.ndarray, velocities: FloatArray) -> FloatArray:
    """Path velocity at ``times_ns``; 0 between two goals."""
    index = np.clip(np.searchsorted(path_ns, times_ns, "right") - 1, 0, len(path_ns) - 1)
    near = np.abs(times_ns - path_ns[index]) < 2_000_000
    return np.where(near, velocities[index], 0.0)


def all_stalls_ns(data: dict[str, np.ndarray], period_s: float) -> np.ndarray:
    """Begin and end (k, 2) of each stall, whether it was made here or by the computer."""
    fresh_ns = data["image"][:, 0].astype(np.int64)
    late = np.diff(fresh_ns) > STALLED_PERIODS * period_s * 1e9
    return np.concatenate([data["stalls_ns"], np.stack([fresh_ns[:-1], fresh_ns[1:]], 1)[late]])


def all_silences_ns(data: dict[str, np.ndarray], period_s: float) -> np.ndarray:
    """Begin and end (k, 2) of the times at which periods of the robot got no new values."""
    fresh_ns, counts = np.unique(data["image"][:, 0].astype(np.int64), return_counts=True)
    silent = np.flatnonzero(counts[:-1] > SILENT_PERIODS)
    return np.stack([fresh_ns[silent], fresh_ns[silent + 1]], 1)


def between(times_ns: np.ndarray, spans_ns: np.ndarray, more_ns: int) -> np.ndarray:
    """True for the times within one of ``spans_ns`` (k, 2), each longer by ``more_ns``."""
    begins = np.searchsorted(times_ns, spans_ns[:, 0])
    ends = np.searchsorted(times_ns, spans_ns[:, 1] + more_ns)
    inside = np.zeros(len(times_ns) + 1, int)
    np.add.at(inside, begins, 1)
    np.add.at(inside, ends, -1)
    return np.cumsum(inside[:-1]) > 0


def runs(flags: np.ndarray) -> int:
    """Number of groups of true values that are at least 50 ticks apart."""
    where = np.flatnonzero(flags)
    return 0 if len(where) == 0 else 1 + int((np.diff(where) > 50).sum())


def stall(
    process: subprocess.Popen[str], times: int, span_s: tuple[float, float], seed: int
) -> np.ndarray:
    """Stop ``process`` ``times`` times for a random time within ``span_s``.

    Returns (times, 2): monotonic times of stop and continuation, ns.
    """
    chance, spans_ns = random.Random(seed), np.zeros((times, 2), np.int64)
    for span_ns in spans_ns:
        time.sleep(chance.uniform(*GAP_S))
        span_ns[0] = time.monotonic_ns()
        process.send_signal(signal.SIGSTOP)
        time.sleep(chance.uniform(*span_s))
        process.send_signal(signal.SIGCONT)
        span_ns[1] = time.monotonic_ns()
    return spans_ns


@contextmanager
def robot_process(
    robot_file: str, backend: str, out: Path, environment: dict[str, str]
) -> Iterator[subprocess.Popen[str]]:
    """``stalled_robot`` while its joints swing; afterwards ``out`` is written."""
    command = [sys.executable, "-m", "tools.endurance.stalled_robot", robot_file, backend, str(out)]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, stdin=pipe, stdout=pipe, text=True, bufsize=1, env=environment, cwd=ROOT
    ) as process:
        try:
            assert process.stdout is not None
            if not any(line == "moving\n" for line in process.stdout):
                raise RuntimeError("the robot did not start")
            yield process
            process.communicate("end\n", timeout=30.0)
        finally:
            process.kill()


def run(
    backend: str, times: int, span_s: tuple[float, float], seed: int, save: Path | None = None
) -> Verdict:
    """Stall a CR3A on ``backend``.

    "sim": its motors are in the stalled process; "canopen", "ethercat": drives in this
    process; "wmx": the stand-in's engine process.
    """
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        robot_file, environment = "cr3a", dict(os.environ)
        motors: Callable[[], dict[str, np.ndarray]] | None = None
        if backend == "canopen":
            from tools.endurance.stalled_drives import drives

            robot_file, recorder = stack.enter_context(drives(Path(folder)))
            motors = recorder.arrays
        elif backend == "ethercat":
            from tools.endurance.stalled_slaves import slaves

            robot_file, recorder = stack.enter_context(slaves(Path(folder)))
            motors = recorder.arrays
        elif backend == "wmx":
            from tools.endurance.stalled_engine import engine

            environment, motors = stack.enter_context(engine(Path(folder)))
        out = Path(folder) / "recording.npz"
        with robot_process(robot_file, backend, out, environment) as process:
            time.sleep(0.3)
            stalls_ns = stall(process, times, span_s, seed)
        data = {**np.load(out), "stalls_ns": stalls_ns, **(motors() if motors else {})}
        if save is not None:
            np.savez(save, **data)
        return judge(times, span_s[1], load_robot_descriptor(robot_file), data)


@click.command()
@click.option(
    "--backend",
    type=click.Choice(["sim", "canopen", "ethercat", "wmx"]),
    default="sim",
    show_default=True,
    help="wmx: needs `make -C plugins/wmx tools`.",
)
@click.option("--times", default=200, show_default=True, help="Number of stalls.")
@click.option("--shortest-ms", default=3.0, show_default=True)
@click.option("--longest-ms", default=200.0, show_default=True)
@click.option("--save", type=click.Path(path_type=Path), help="Keep the recording (npz).")
@click.option("--seed", type=int, default=1, show_default=True)
def main(
    backend: str, times: int, shortest_ms: float, longest_ms: float, save: Path | None, seed: int
) -> None:
    """Print the extremes of the motors; exit status 1 when one is beyond its limit."""
    if backend == "wmx":
        from tools.endurance.stalled_engine import build

        build()
    verdict = run(backend, times, (shortest_ms * 1e-3, longest_ms * 1e-3), seed, save)
    for name, value in asdict(verdict).items():
        click.echo(f"{name:14} {value}")
    sys.exit(bool(verdict.reversals or verdict.leaps or verdict.jerks or verdict.failures))


if __name__ == "__main__":
    main()
