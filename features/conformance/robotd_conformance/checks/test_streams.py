"""Position streams: in time, in both directions, as small as they are, group by group."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest

from robotd.api import FloatArray, Operation, ProcessImage
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_conformance.checks.recorded_motion import judge, ramped, record_stream
from robotd_conformance.checks.test_units import stream_ramp

RAMP_S, BRAKE_S, SHARE = 0.2, 0.5, 0.2
LATE_PERIODS, LATE_PERIODS_IN_REAL_TIME = 0.6, 3.0
SLOW_RAD_S = 0.02  # the setpoints of two periods are then some 0.00005 rad apart


class Ramp:
    """Setpoints of a ramp to a speed and back, and what the device showed meanwhile."""

    def __init__(self, harness: Harness, speeds: FloatArray) -> None:
        self._harness, self._speeds = harness, speeds
        self._start = harness.image.position_command.copy()
        self._began_ns = harness.clock.now_ns()
        self.times_s: list[float] = []
        self.commands: list[FloatArray] = []
        self.operations: list[list[int]] = []

    def setpoint(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        distance_s, share = ramped(max(0.0, time_s), RAMP_S, BRAKE_S)
        return self._start + distance_s * self._speeds, share * self._speeds

    def __call__(self, image: ProcessImage) -> None:
        self.times_s.append((image.fresh_ns - self._began_ns) * 1e-9)
        self.commands.append(image.position_command.copy())
        self.operations.append(image.operation.tolist())
        self._harness.stream(*self.setpoint((self._harness.due_ns - self._began_ns) * 1e-9))

    def lags_s(self) -> FloatArray:
        """(n_axes,) by how much the command is behind its setpoints, at full speed."""
        cruise = [
            (time_s, command)
            for time_s, command in zip(self.times_s, self.commands, strict=True)
            if RAMP_S + 0.05 < time_s < BRAKE_S
        ]
        behind = [(self.setpoint(time_s)[0] - command) / self._speeds for time_s, command in cruise]
        return np.asarray(np.mean(behind, axis=0))


@pytest.mark.clause("AxisDriver.stream/setpoint", "AxisDriver.stream/position")
@pytest.mark.clause("AxisDriver.stream_buffer_s/later", "AxisDriver.begin_stream/operation")
def test_a_setpoint_is_reached_when_it_is_due(streamed: Harness) -> None:
    buffer_s, period_s = streamed.drivers.axes.stream_buffer_s, streamed.period_s
    periods = LATE_PERIODS if streamed.stepped else LATE_PERIODS_IN_REAL_TIME
    slow_feedback_s = streamed.drivers.axes.feedback_period_s  # commands are newer than values
    granted_s = periods * period_s + slow_feedback_s
    for sign in (1.0, -1.0):
        ramp = Ramp(streamed, sign * streamed.speeds(SHARE))
        recording = record_stream(streamed, ramp, BRAKE_S + RAMP_S + 0.1)
        lags_s = ramp.lags_s()
        problems = [
            f"axis {axis}: setpoints are reached {1e3 * lag_s:.2f} ms after they are due"
            for axis, lag_s in enumerate(lags_s)
            if not -granted_s <= lag_s <= buffer_s + granted_s
        ]
        streams = [set(row) == {Operation.STREAM} for row in ramp.operations[10:-10]]
        if np.mean(streams) < 0.9:
            problems.append("the axes are not in Operation.STREAM")
        judge(streamed, recording, problems)


@pytest.mark.clause("AxisDriver.stream/position", "AxisDriver.begin_stream/follows")
def test_streams_may_follow_on_each_other(streamed: Harness) -> None:
    start = streamed.image.position_command.copy()
    for share in (0.2, 0.05, 0.15, 0.15, 0.0):
        end = start + share * streamed.travel()
        stream_ramp(streamed, streamed.image.position_command.copy(), end, seconds=0.6)
        assert not streamed.off_target(end)
        assert (streamed.image.operation == Operation.IDLE).all()


@pytest.mark.clause("AxisDriver.stream/position")
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["forth", "back"])
def test_a_slow_stream_is_followed(streamed: Harness, sign: float) -> None:
    ramp = Ramp(streamed, sign * SLOW_RAD_S * np.sign(streamed.travel()))
    start = streamed.image.position_command.copy()
    record_stream(streamed, ramp, BRAKE_S + RAMP_S + 0.1)
    end, _ = ramp.setpoint(2.0)
    assert np.abs(end - start).min() > 2 * SETTLED_RAD
    assert streamed.image.position_command == pytest.approx(end, abs=0.5 * SETTLED_RAD)
    assert not streamed.off_target(end)


@pytest.mark.clause("AxisDriver.end_stream/holds", "AxisDriver.end_stream/moves")
@pytest.mark.clause("AxisDriver.begin_stream/follows", "AxisDriver.stream/others")
def test_groups_of_axes_stream_by_themselves(streamed: Harness) -> None:
    """The last axis begins to stream later, and ends earlier, than the others."""
    if streamed.count < 2:
        pytest.skip(f"the robot {streamed.robot.descriptor.name} has one axis")
    last, others = streamed.count - 1, streamed.all[:-1]
    ramp = Ramp(streamed, streamed.speeds(SHARE))
    start = streamed.image.position_command.copy()
    stops = streamed.robot.axes.stops.counts.copy()
    with ExitStack() as streams, streamed.recording() as recording:
        streams.enter_context(streamed.robot.axes.claimed("others", others))
        streams.enter_context(streamed.each_period(ramp))
        streamed.pass_time(0.05)
        with streamed.robot.axes.claimed("last", [last]):
            streamed.pass_time(0.05)
        streamed.pass_time(BRAKE_S + RAMP_S)
    streamed.rest()
    stopped = np.not_equal(streamed.robot.axes.stops.counts, stops)
    end, _ = ramp.setpoint(2.0)
    problems = streamed.off_target(end, others)
    if abs(streamed.image.position[last] - start[last]) > 0.5 * abs(end - start)[last]:
        problems.append(f"axis {last} was streamed on after its end")
    problems += [  # the core stops an axis whose stream does not end: it hides the fault
        f"axis {axis} went on streaming after end_stream, until the core stopped it"
        for axis in np.flatnonzero(stopped)
    ]
    judge(streamed, recording, problems)
    targets = streamed.image.position_command - 0.1 * streamed.travel()
    streamed.move(streamed.all, targets)
    streamed.rest()
    assert not streamed.off_target(targets)
