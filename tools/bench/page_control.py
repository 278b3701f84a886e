"""Time until a jogged joint is at rest: ``python -m tools.bench.page_control [--rounds 20]``.

A client jogs a joint of a simulated arm as fast as a page may, over the page's WebSocket, and ends
in three ways. Printed is the time from its last message until the measured velocity stays below
``AT_REST``, from the frames of the control loop: median and maximum of the rounds. The limit is
150 ms. A computer that stalls adds the time for which the control loop did not run, which is
printed too.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import aiohttp
import numpy as np

from robotd.clock import NANOSECONDS
from robotd.device.process_image import VALUES
from robotd.log import configure_logging
from robotd.observation.tap import Tap
from robotd.robot import Robot, build_robot
from robotd_page.control_jog import jog_velocities
from robotd_page.control_server import PageControl
from robotd_page.held_motion import HEARTBEAT_S
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import PageServer
from robotd_recorder.recorder import observed
from robotd_scenario.fault_schedule import FaultSchedule, RequestedFaults

AT_REST = 1e-3  # rad/s
VELOCITY_ROW = VALUES.index("velocity")
HELD_S = 0.6
SETTLE_S = 0.5

Socket = aiohttp.ClientWebSocketResponse


async def release(socket: Socket, hold: int) -> None:
    await socket.send_str(json.dumps({"type": "release", "hold": hold, "reason": "released"}))


async def close(socket: Socket, hold: int) -> None:
    await socket.close()


async def fall_silent(socket: Socket, hold: int) -> None:
    """Send nothing more; the connection stays open."""


ENDS: dict[str, Callable[[Socket, int], Awaitable[None]]] = {
    "button released": release,
    "tab closed": close,
    "no heartbeat": fall_silent,
}


async def jog(robot: Robot, url: str, token: str, joint: str, velocity: float, end: str) -> int:
    """Hold a button, end as ``end`` says, and return the monotonic time of the last message."""
    async with aiohttp.ClientSession() as session, session.ws_connect(f"{url}control") as socket:
        await socket.send_str(json.dumps({"token": token}))
        await socket.receive()
        seen = {"events": robot.events.added, "time_s": robot.clock.now_ns() / NANOSECONDS}
        message = {"type": "jog", "hold": 1, "joint": joint, "velocity": velocity, "seen": seen}
        until_ns = time.monotonic_ns() + round(HELD_S * 1e9)
        last_ns = 0
        while last_ns < until_ns:
            await socket.send_str(json.dumps(message))
            last_ns = time.monotonic_ns()
            await asyncio.sleep(HEARTBEAT_S)
        if end != "no heartbeat":
            last_ns = time.monotonic_ns()
        await ENDS[end](socket, 1)
        await asyncio.sleep(SETTLE_S)
        return last_ns


def stop_times(tap: Tap, axis: int, since: int, last_ns: int) -> tuple[float, float]:
    """Time until rest, and the longest gap between two periods meanwhile, ms.

    The time is NaN where the joint did not move at the end, because heartbeats had been late.
    """
    frames, _, _ = tap.frames.since(since)
    moving = np.abs(frames["values"][:, VELOCITY_ROW, axis]) > AT_REST
    times_ns = frames["start_ns"]
    if not (moving & (times_ns > last_ns - HEARTBEAT_S * NANOSECONDS)).any():
        return float("nan"), 0.0
    rest_ns = times_ns[moving][-1]
    window = times_ns[(times_ns >= last_ns) & (times_ns <= rest_ns)]
    gap_ns = np.diff(window).max() if len(window) > 1 else 0
    return (rest_ns - last_ns) / 1e6, gap_ns / 1e6


def main(name: str, rounds: int) -> None:
    robot = build_robot(name, "sim")
    joint, axis = robot.joint_names[0], robot.joint_axes[0]
    velocity = jog_velocities(robot)[joint]
    with (
        tempfile.TemporaryDirectory() as folder,
        observed(robot, flight_folder=Path(folder)) as recorder,
    ):
        control = PageControl(robot, RequestedFaults(FaultSchedule(robot)))
        with PageServer(RobotSource(recorder.tap, []), 0, control=control) as server:
            robot.start()
            print(f"{joint} at {velocity:.3f} rad/s; from the last message to rest:")
            for end in ENDS:
                found = []
                for number in range(rounds):
                    since, sign = recorder.tap.frames.written, 1 - 2 * (number % 2)
                    last_ns = asyncio.run(
                        jog(robot, server.url, control.token, joint, sign * velocity, end)
                    )
                    found.append(stop_times(recorder.tap, axis, since, last_ns))
                report(end, np.array(found))
            robot.shutdown()


def report(end: str, found: np.ndarray) -> None:
    times_ms, gaps_ms = found[~np.isnan(found[:, 0])].T
    print(
        f"{end:16} median {np.median(times_ms):4.0f} ms, maximum {times_ms.max():4.0f} ms,"
        f" {len(times_ms)} of {len(found)} rounds (others: stopped before, heartbeats were late);"
        f" longest gap of the control loop {gaps_ms.max():.0f} ms"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--robot", default="cr3a")
    options = parser.parse_args()
    configure_logging("error")
    main(options.robot, options.rounds)
