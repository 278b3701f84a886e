"""Positions streamed through the cyclic buffers of the engine's process."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.state import Operation
from robotd_wmx import _native, position_stream
from robotd_wmx._native import CallError, Device, PositionStream, Snapshot
from robots import eventually, goal, running
from standin_port import port
from standin_trace import CYCLE_S, Trace

PERIOD_S, BUFFER_S = 0.002, 0.02
END_RAD = 1e-3  # a rest of an underrun, on a busy computer
SPEED_UP_S = 0.1  # from standstill to the path's speed, at least; stalls make it longer
VELOCITY, ACCELERATION = 3.0, 10.0  # limits
TRIES = 10


@pytest.fixture
def puts(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, float, float]]:
    """Position, velocity and due time of joint 1 in each setpoint of a robot, from its first on."""
    rows: list[tuple[float, float, float]] = []
    put = position_stream.PositionStream.put

    def noted(
        self: position_stream.PositionStream, position: Any, velocity: Any, due_ns: int
    ) -> None:
        rows.append((float(position[0]), float(velocity[0]), due_ns / 1e9))
        put(self, position, velocity, due_ns)

    monkeypatch.setattr(position_stream.PositionStream, "put", noted)
    return rows


def test_trajectories_are_streamed_where_the_sdk_has_cyclic_buffers(tmp_path: Path) -> None:
    assert _native.CYCLIC_BUFFER
    with running(tmp_path) as robot:
        assert not robot.axes.trajectories_on_device
        with robot.follower.follow(goal([0.6], 0.3)) as execution:
            eventually(lambda: "axis 0 servo 1 state 11" in port("show"))  # DirectControl
            assert execution.wait(30.0)
        assert execution.outcome is Outcome.SUCCEEDED, execution.message
        eventually(lambda: bool((robot.image.operation == Operation.IDLE).all()))
        np.testing.assert_allclose(robot.image.position_command, 0.3, atol=END_RAD)


def test_preemption_has_no_standstill(
    tmp_path: Path, puts: list[tuple[float, float, float]]
) -> None:
    """In the setpoints: where a busy computer lets a buffer run dry, the engine stops by itself."""
    with running(tmp_path) as robot:
        with robot.follower.follow(goal([4.0], 1.0)) as first:
            eventually(lambda: puts and puts[-1][1] > 0.2)
            begin = len(puts)
            with robot.follower.follow(goal([2.0], 0.8)) as second:
                eventually(lambda: first.done)
                end = len(puts)
                assert second.wait(30.0)
        assert first.outcome is Outcome.PREEMPTED
        assert second.outcome is Outcome.SUCCEEDED, second.message
    positions, velocities, due_s = np.array(puts[begin:]).T
    run_dry_s = due_s[1:][np.diff(due_s) > BUFFER_S]
    since_s = due_s[: end - begin, None] - run_dry_s
    slow = velocities[: end - begin] <= 0.15
    assert not (slow & ~((since_s >= 0.0) & (since_s < SPEED_UP_S)).any(axis=1)).any()
    # rad/s: the second one goes on from the first; on a busy computer some periods later.
    assert (np.diff(positions) / np.diff(due_s)).max() < 2.0
    assert positions[-1] == pytest.approx(0.8, abs=END_RAD)


@pytest.fixture
def device() -> Iterator[Device]:
    device = Device()
    device.create(_native.SDK_PATH, 5000)
    device.start_communication(5000)
    for axis in range(2):
        device.set_servo(axis, True)
    eventually(lambda: all(Snapshot(device).servo_on(axis) for axis in range(2)))
    yield device
    device.close(False)


def make_stream(device: Device) -> PositionStream:
    limits = [VELOCITY] * 2, [ACCELERATION] * 2
    return PositionStream(device, [1.0] * 2, *limits, PERIOD_S, BUFFER_S, 0)


@pytest.fixture
def stream(device: Device) -> Iterator[PositionStream]:
    stream = make_stream(device)
    stream.begin([0, 1])
    yield stream
    stream.close()


def run_dry(device: Device) -> float:
    """Wait for the end of a gap that counts as an underrun; the position of both axes then."""
    end_ns = time.monotonic_ns() + round((2 * PERIOD_S + BUFFER_S) * 1e9)
    eventually(lambda: time.monotonic_ns() > end_ns and Snapshot(device).velocity_command(0) == 0.0)
    return Snapshot(device).position_command(0)


def feed(stream: PositionStream, seconds: float, speed: float, start: float = 0.0) -> float:
    """Setpoints at constant speed in real time; returns the last position."""
    begin_ns, position = time.monotonic_ns(), start
    for step in range(1, round(seconds / PERIOD_S) + 1):
        due_ns = begin_ns + round(step * PERIOD_S * 1e9)
        position = start + speed * step * PERIOD_S
        stream.put(np.full(2, position), np.full(2, speed), due_ns)
        time.sleep(max(0.0, (due_ns - time.monotonic_ns()) * 1e-9))
    return position


def test_a_stop_slows_down_and_both_axes_end_together(
    trace: Trace, device: Device, stream: PositionStream
) -> None:
    feed(stream, 0.3, 0.5)
    stop_ns = time.monotonic_ns()
    stream.stop([0, 1])
    eventually(lambda: not (stream.active(0) or stream.active(1)))
    ends = [Snapshot(device).position_command(axis) for axis in range(2)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    assert Snapshot(device).idle(0)
    device.stop_engine(5000)
    velocities = trace.velocities(stop_ns)
    assert velocities.min() >= -1e-9
    assert velocities[-1] == 0.0
    braking = velocities[: np.count_nonzero(velocities)]
    assert np.abs(np.diff(braking)).max(initial=0.0) / CYCLE_S < 1.2 * ACCELERATION


def test_an_emptied_buffer_holds_and_continues_from_there(
    device: Device, stream: PositionStream
) -> None:
    last = feed(stream, 0.2, 0.5)
    held = run_dry(device)
    assert 0.0 < held <= last + 1e-9
    feed(stream, 0.1, 0.0, last)
    assert held - 1e-9 <= Snapshot(device).position_command(0) <= last + 1e-9
    assert stream.active(0)
    assert stream.fault == ""


def test_a_setpoint_that_comes_after_the_buffer_has_run_dry_makes_no_leap(
    trace: Trace, device: Device, stream: PositionStream
) -> None:
    """The process was stopped between a setpoint and its transfer to the engine."""
    tries, late = [], 0.0
    for _ in range(TRIES):  # a busy computer lets the buffer run dry in the midst
        begin_ns = time.monotonic_ns()
        last = feed(stream, 0.2, 0.5, late)
        run_dry(device)
        dry_ns, late = time.monotonic_ns(), last + 0.5 * PERIOD_S
        stream.put(np.full(2, late), np.full(2, 0.5), begin_ns + 202_000_000)
        feed(stream, 0.1, 0.0, late)
        tries.append((dry_ns, time.monotonic_ns()))
    stream.stop([0, 1])
    eventually(lambda: not (stream.active(0) or stream.active(1)))
    device.stop_engine(5000)
    good = 0
    for dry_ns, end_ns in tries:
        after = trace.velocities(dry_ns)
        velocities = after[: len(after) - len(trace.velocities(end_ns))]
        change = np.abs(np.diff(velocities, axis=0)).max() / CYCLE_S
        good += bool(0.0 < np.abs(velocities).max() < 0.1 and change < 1.5 * ACCELERATION)
    assert good >= TRIES / 2


def test_moving_setpoints_that_find_dry_buffers_are_ignored_until_a_gap(
    device: Device, stream: PositionStream
) -> None:
    """Else the axes would begin at rest behind setpoints at full speed, and stay behind them."""
    held = 0.0
    for _ in range(TRIES):  # a busy computer lets the buffer run dry in the midst
        last_ns = time.monotonic_ns() + 200_000_000
        last = feed(stream, 0.2, 0.5, held)
        held = run_dry(device)
        next_ns = last_ns + round(PERIOD_S * 1e9)
        if not stream.ran_dry(next_ns):
            break
        feed(stream, 0.2, 0.0, held)
    after_gap_ns = last_ns + round((3.5 * PERIOD_S + BUFFER_S) * 1e9)
    assert not stream.ran_dry(next_ns)
    stream.put(np.full(2, last + 0.001), np.full(2, 0.5), next_ns)
    eventually(lambda: stream.ran_dry(next_ns))
    stream.put(np.full(2, last + 0.002), np.full(2, 0.5), next_ns + round(PERIOD_S * 1e9))
    assert not stream.ran_dry(after_gap_ns)
    stream.put(np.full(2, held), np.zeros(2), after_gap_ns)
    assert not stream.ran_dry(next_ns)
    feed(stream, 0.1, 0.0, held)
    assert Snapshot(device).position_command(0) == pytest.approx(held, abs=1e-9)


def test_setpoints_at_rest_at_any_pace_find_no_dry_buffers(
    device: Device, stream: PositionStream
) -> None:
    last, taken = feed(stream, 0.1, 0.0), 0
    for _ in range(TRIES):  # where the engine stands still on a busy computer, its buffers are full
        run_dry(device)
        due_ns = time.monotonic_ns()
        feed(stream, 2 * PERIOD_S, 0.0, last)
        taken += not stream.ran_dry(due_ns + round(PERIOD_S * 1e9))
    assert taken >= TRIES / 2


def test_a_difference_from_the_setpoints_goes_away(device: Device, stream: PositionStream) -> None:
    """A goal waits for that at its end, and fails after ``goal_time_s``."""
    last = feed(stream, 0.2, 0.5)
    run_dry(device)
    target = last + 0.02
    for _ in range(5):  # it takes a second; setpoints come late on a busy computer
        feed(stream, 1.0, 0.0, target)
        if abs(Snapshot(device).position_command(0) - target) < 1e-3:
            break
    assert Snapshot(device).position_command(0) == pytest.approx(target, abs=1e-3)


def test_a_stop_of_a_buffer_that_has_run_dry_moves_nothing(
    device: Device, stream: PositionStream
) -> None:
    feed(stream, 0.2, 0.5)
    held = run_dry(device)
    stream.stop([0, 1])
    eventually(lambda: not (stream.active(0) or stream.active(1)))
    assert Snapshot(device).position_command(0) == pytest.approx(held, abs=1e-9)


def test_an_exceeded_acceleration_ends_the_stream_with_its_reason(
    device: Device, stream: PositionStream
) -> None:
    """On a busy computer the buffer may have run dry before the jump, which then becomes a ramp."""
    port("max_acc", 0, 100)
    at, jump = 0.0, 0.5
    for _ in range(TRIES):
        feed(stream, 0.05, 0.0, at)
        at += jump
        stream.put(np.full(2, at), np.zeros(2), time.monotonic_ns() + 2_000_000)
        feed(stream, 0.1, 0.0, at)
        if not stream.active(0):
            break
        feed(stream, 1.0, 0.0, at)  # until a ramp has ended
        jump = -jump
    assert not stream.active(0)
    assert "axis 0" in stream.fault
    assert "MaxAccError" in stream.fault
    assert stream.active(1)
    stream.stop([1])
    eventually(lambda: not stream.active(1))
    stream.begin([0, 1])  # the latched error is cleared
    assert stream.fault == ""
    assert stream.active(0)


def test_a_servo_that_goes_off_ends_its_axis_alone(device: Device, stream: PositionStream) -> None:
    feed(stream, 0.05, 0.0)
    device.set_servo(0, False)
    eventually(lambda: not Snapshot(device).servo_on(0))
    feed(stream, 0.05, 0.0)
    assert not stream.active(0)
    assert stream.active(1)


def test_where_one_axis_cannot_stream_none_does(device: Device) -> None:
    device.set_servo(1, False)
    eventually(lambda: not Snapshot(device).servo_on(1))
    stream = make_stream(device)
    with pytest.raises(CallError, match="CyclicBuffer::Execute"):
        stream.begin([0, 1])
    assert not stream.active(0)
    assert Snapshot(device).idle(0)
    stream.close()


@pytest.mark.parametrize("quick", [False, True])
def test_a_stop_that_one_axis_cannot_make_stops_the_others(
    device: Device, stream: PositionStream, quick: bool
) -> None:
    feed(stream, 0.2, 0.5)
    taken_over = make_stream(device)  # as by another program on the engine
    taken_over.begin([0])
    taken_over.close()
    (stream.quick_stop if quick else stream.stop)([0, 1])
    assert stream.stopping(1) or not stream.active(1)
    assert not stream.active(0)
    assert "BufferIsNotOpened" in stream.fault
    eventually(lambda: not stream.active(1))
    eventually(lambda: Snapshot(device).idle(1))


LEAVER = """\
import sys, time
sys.path.insert(0, sys.argv[1])
from robotd_wmx import _native
device = _native.Device()
device.create(_native.SDK_PATH, 5000)
stream = _native.PositionStream(device, [1.0] * 2, [3.0] * 2, [10.0] * 2, 0.002, 0.02, 0)
stream.begin([0, 1])
print("streaming", flush=True)
time.sleep(60)
"""


def test_a_buffer_that_a_killed_process_has_left_is_opened_again(device: Device) -> None:
    command = [sys.executable, "-P", "-c", LEAVER, str(Path(_native.__file__).parents[1])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as leaver:
        assert leaver.stdout is not None
        assert leaver.stdout.readline().strip() == "streaming"
        os.kill(leaver.pid, signal.SIGKILL)
    stream = make_stream(device)
    stream.begin([0, 1])
    feed(stream, 0.1, 0.2)
    assert Snapshot(device).position_command(1) > 0.0
    stream.close()
