"""Watchdog of the device: moving axes stop when setpoints or the process end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from robotd.api import Capability
from robotd_conformance.checks import killed_process
from robotd_conformance.checks.harness import SETTLED_RAD, Harness, MakeHarness
from robotd_conformance.checks.inconclusive import CERTAIN
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.recorded_motion import ramped

pytestmark = pytest.mark.needs(Capability.DEVICE_WATCHDOG)

MOVES_S = 0.5
WATCHDOG_S, GONE_S = 1.0, 2.5  # longest reaction of a device, and time until it is looked at


@contextmanager
def starved(streamed: Harness) -> Iterator[None]:
    """Stream half a second of a motion, then nothing for a second and in the block."""
    start = streamed.image.position_command.copy()
    speeds = streamed.speeds(0.3)
    began_ns = streamed.clock.now_ns()

    def setpoint(image: object) -> None:
        time_s = (streamed.clock.now_ns() - began_ns) * 1e-9 + streamed.period_s
        distance_s, share = ramped(time_s, 0.2)
        if time_s < 0.5:
            streamed.stream(start + speeds * distance_s, speeds * share)

    claim = streamed.robot.axes.claimed("conformance", streamed.all)
    with claim, streamed.each_period(setpoint):
        streamed.pass_time(1.5)
        yield


@pytest.mark.clause("backend/watchdog")
def test_an_axis_stops_when_setpoints_stay_away(streamed: Harness) -> None:
    with starved(streamed), streamed.recording() as recording:
        streamed.pass_time(0.3)
    assert np.ptp(recording.position, 0).max() <= SETTLED_RAD, "it went on without setpoints"


@pytest.mark.clause("AxisDriver.read/reason")
def test_the_reason_of_a_stop_ends_with_the_next_command(streamed: Harness) -> None:
    """The device has stopped the axes because setpoints stayed away; an alarm stays as it is."""
    with starved(streamed):
        image = streamed.image
    streamed.pass_time(0.1)
    if image.amp_alarm.any() or not image.servo_on.all():
        pytest.skip("the device reports an alarm when setpoints stay away")
    streamed.move(streamed.all, image.position_command + streamed.travel(0.1))
    streamed.rest()
    assert not any(image.reason), "the reason of a past stop is still shown after a move"


@pytest.mark.clause("backend/watchdog")
def test_axes_stop_when_their_process_is_killed(
    make_harness: MakeHarness, target: KitTarget
) -> None:
    harness = make_harness(real_time=True)
    injector = harness.fault_injector
    if injector is not None and injector.in_process:
        pytest.skip("the device is simulated in the process and ends with it")
    last = last_positions(target)
    time.sleep(GONE_S)
    harness.start(enable=False)
    distance = np.abs(harness.image.position - last)
    limit = killed_process.SPEED_RAD_S * WATCHDOG_S + SETTLED_RAD
    certain = (
        f": {CERTAIN}" if distance.max() > 2.0 * limit else ""
    )  # drives would stall for a second
    assert distance.max() <= limit, (
        f"axes moved by {distance} rad after their process was killed{certain}"
    )


def last_positions(target: KitTarget) -> list[float]:
    """Let another process move the axes, kill it, and return what it measured last."""
    command = [sys.executable, "-m", killed_process.__name__, *target.arguments]
    began_s, last = 0.0, ""
    with subprocess.Popen(  # noqa: S603 - our own module
        command, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                last, began_s = line, began_s or time.monotonic()
                if time.monotonic() - began_s > MOVES_S:
                    break
            process.send_signal(signal.SIGKILL)
            last = [last, *process.stdout.readlines()][-1]
        finally:
            process.kill()
    assert last, "the other process ended before its axes moved"
    return list(json.loads(last))
