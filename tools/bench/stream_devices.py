"""Streams on a device in real time: lag and ripple as measured, and the steps of a takeover.

``python -m tools.bench.stream_devices``: the simulated CiA 402 drives of a CR3A, and the
simulation. With ``--backend wmx`` in an environment that has the stand-in's engine
(``make -C plugins/wmx build``, ``PYTHONPATH=plugins/wmx/build/site``). The takeover is judged by
the setpoints that the device gets; where the control loop stalled, it is repeated.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from tools.bench.machine import machine
from tools.bench.results import keep, out_option
from tools.bench.streams import AMPLITUDE, ANGULAR, SECONDS, judged

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.errors import RobotdError
from robotd.log import configure_logging
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, open_robot

RATES_HZ = (10, 30, 100)
DEVICES = (("sim", "intel"), ("canopen", "canopen_simulated"))
TAKEOVERS = 3  # without a stall
ATTEMPTS = 12
CLOCK = MonotonicClock()


class Recorder:
    """Setpoints that the device got, and values that were measured."""

    def __init__(self, robot: Robot) -> None:
        self.setpoints: list[tuple[float, float, float]] = []
        self.measured: list[tuple[float, float, float]] = []
        axis = robot.joint_axes[0]
        driver = robot.control_loop._mixer._driver
        stream = driver.stream

        def record(position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            stream(position, velocity, due_ns)
            self.setpoints.append((due_ns / NANOSECONDS, position[axis], velocity[axis]))

        driver.stream = record  # type: ignore[method-assign]
        robot.control_loop.every(
            robot.descriptor.cycle.rate_hz,
            "bench",
            lambda image: self.measured.append(
                (image.fresh_ns / NANOSECONDS, image.position[axis], image.velocity[axis])
            ),
        )


def sleep(seconds: float) -> None:
    CLOCK.sleep_until_ns(CLOCK.now_ns() + round(seconds * NANOSECONDS))


@contextmanager
def running(robot: str, backend: str, variant: str | None) -> Iterator[tuple[Robot, Recorder]]:
    with open_robot(robot, backend, variant) as opened:
        yield opened, Recorder(opened)


def sine(robot: Robot, recorder: Recorder, rate_hz: float, mode: str) -> dict[str, float]:
    """Stream a sine for ``SECONDS``; return lag and ripple of setpoints and measured values."""
    with robot.stream(mode=mode, timeout_s=0.5) as stream:
        began_ns = CLOCK.now_ns()
        for index in range(round(SECONDS * rate_hz)):
            CLOCK.sleep_until_ns(began_ns + round(index / rate_hz * NANOSECONDS))
            stream.send([AMPLITUDE * np.sin(ANGULAR * index / rate_hz)] * len(stream.joints))
    end_s = began_ns / NANOSECONDS + SECONDS
    found: dict[str, float] = {}
    for name, rows in (("setpoints", recorder.setpoints), ("measured", recorder.measured)):
        table = np.array(rows)
        table = table[(table[:, 0] > began_ns / NANOSECONDS) & (table[:, 0] < end_s)]
        table[:, 0] -= began_ns / NANOSECONDS
        found |= {f"{name}_{key}": value for key, value in judged(table).items()}
    return found


def takeover(robot: Robot, recorder: Recorder) -> dict[str, float] | None:
    """Goal, stream, goal, all in motion; return the largest steps, None after a stall."""
    first = len(recorder.setpoints)
    names = robot.joint_names
    robot.follower._takeover = True  # as with stream.takeover in the descriptor
    with ExitStack() as sources:

        def go(target: float, seconds: float) -> None:
            request = TrajectoryRequest.from_rows(names, [seconds], [[target] * len(names)])
            sources.enter_context(robot.follower.follow(request))

        go(0.6, 2.0)
        sleep(0.8)
        stream = sources.enter_context(robot.stream(takeover=True, timeout_s=0.5))
        for index in range(15):
            stream.send([0.3 + 0.01 * index] * len(names), [0.3] * len(names))
            sleep(1 / 30)
        go(-0.3, 2.0)
        sleep(1.0)
        rows = np.array(recorder.setpoints[first:])
        go(0.0, 3.0)
        sleep(4.0)
    time_s, position, velocity = rows.T
    period_s = 1.0 / robot.descriptor.cycle.rate_hz
    if np.diff(time_s).max() > 1.5 * period_s:
        return None
    limit = robot.follower.limits.acceleration[0]
    travelled = np.diff(position) - (velocity[1:] + velocity[:-1]) / 2.0 * period_s
    middle = slice(len(velocity) // 6, len(velocity) // 2)
    return {
        "position_step_rad": float(max(0.0, np.abs(travelled).max() - limit * period_s**2 / 6)),
        "velocity_step_rad_s": float(max(0.0, np.abs(np.diff(velocity)).max() - limit * period_s)),
        "slowest_rad_s": float(np.abs(velocity[middle]).min()),
    }


def without_stall(robot: Robot, attempt: Callable[[], Any]) -> Any:
    """Return the result of ``attempt``, repeated where a stall of the computer ended the motion."""
    for _ in range(ATTEMPTS):
        try:
            return attempt()
        except RobotdError as error:
            click.echo(f"repeated: {error}")
            sleep(2.0)
            robot.recover()
    raise SystemExit(f"{ATTEMPTS} attempts on a busy computer have failed")


def worst(attempt: Callable[[], dict[str, float] | None]) -> dict[str, float]:
    """Return the largest values of ``TAKEOVERS`` attempts without a stall."""
    found: list[dict[str, float]] = []
    for attempts in range(1, ATTEMPTS + 1):
        if (steps := attempt()) is not None:
            found.append(steps)
        if len(found) == TAKEOVERS:
            largest = {key: max(row[key] for row in found) for key in found[0]}
            return largest | {"takeovers": TAKEOVERS, "stalled": attempts - TAKEOVERS}
    return {"takeovers": len(found), "stalled": ATTEMPTS - len(found)}


def measure(robot: str, backend: str, variant: str | None) -> dict[str, Any]:
    results: dict[str, Any] = {}
    with running(robot, backend, variant) as (opened, recorder):
        for mode in ("target", "smooth"):
            for rate_hz in RATES_HZ:
                figures = without_stall(opened, partial(sine, opened, recorder, rate_hz, mode))
                results[f"{mode}-{rate_hz}"] = figures
                click.echo(
                    f"{backend:9}{mode:8}{rate_hz:4} Hz"
                    f"{figures['setpoints_lag_ms']:9.1f}{figures['measured_lag_ms']:9.1f}"
                    f"{figures['setpoints_ripple_rad_s']:10.4f}"
                    f"{figures['measured_ripple_rad_s']:10.4f}"
                )
        again = partial(without_stall, opened, partial(takeover, opened, recorder))
        steps = results["takeover"] = worst(again)
        click.echo(f"{backend}: " + ", ".join(f"{key} {value:.2g}" for key, value in steps.items()))
    return results


@click.command()
@click.option("--robot", default="cr3a", show_default=True)
@click.option("--backend", help="One backend instead of sim and canopen.")
@click.option("--variant")
@out_option
def main(robot: str, backend: str | None, variant: str | None, out: Path) -> None:
    """Measure streams on devices; write stream_devices.json, or that of one backend."""
    configure_logging("error")
    devices = ((backend, variant),) if backend else DEVICES
    click.echo(f"{'':20}{'lag ms: sent':>13}{'moved':>9}{'ripple: sent':>13}{'moved':>9}")
    results = {name: measure(robot, name, stand_in) for name, stand_in in devices}
    out.mkdir(parents=True, exist_ok=True)
    name = f"stream_devices_{backend}" if backend else "stream_devices"
    keep(out, name, {"machine": machine(), "load": os.getloadavg()[0], **results})


if __name__ == "__main__":
    main()
