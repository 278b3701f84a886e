"""Trajectories that the device interpolates: start, supervision, stop, outcome."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fakes import FakeAxes, FakeClock

from robotd.clock import MonotonicClock, wait_until
from robotd.control.groups.descriptor_limits import trajectory_rules
from robotd.control.loop.setpoint_mixer import SetpointMixer
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.device_trajectory import STOP_TIME_RATIO, DeviceTrajectory, stop_time
from robotd.control.sources.trajectory_execution import PlannedGoal, TrajectoryExecution
from robotd.descriptor.model import TrajectorySettings
from robotd.device.axis_stops import AxisStops
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import OperationError, Unsupported
from robotd.motion import (
    JointLimits,
    JointTolerance,
    MotionState,
    Tolerances,
    TrajectoryRequest,
    plan,
)

NAMES = ("a", "b")
PERIOD_NS = 2_000_000
LIMITS = JointLimits(NAMES, np.full(2, -3.0), np.full(2, 3.0), np.full(2, 3.0), np.full(2, 10.0))
RULES = trajectory_rules(TrajectorySettings(), LIMITS.units)


class Harness:
    """Two fake axes and a mixer that the test steps."""

    def __init__(self, *, velocities: bool = False, target: float = 0.5) -> None:
        self.axes = FakeAxes(2)
        self.axes.image.servo_on[:] = True
        self.given_up: set[int] = set()
        self.image = ProcessImage(2)
        self.mixer = SetpointMixer(self.axes, 2, 1e9 / PERIOD_NS)
        self.slot = self.mixer.slot()
        self.clock = FakeClock()
        self.stops = AxisStops(self.axes, self.image, lambda: True, NAMES, self.clock, 0.1, 3.0)
        self.time_ns = 1_000_000_000
        rows = ([[0.0, 0.0], [0.0, 0.0]],) if velocities else ()
        request = TrajectoryRequest.from_rows(
            NAMES, [0.5, 1.0], [[target / 2] * 2, [target] * 2], *rows
        )
        self.trajectory = plan(request, LIMITS, RULES, MotionState.at_rest(np.zeros(2)))

    def start(self, limits: JointLimits = LIMITS) -> TrajectoryExecution:
        indices = np.array([0, 1])
        goal = PlannedGoal(
            self.trajectory,
            indices,
            limits,
            Tolerances(LIMITS, RULES, [JointTolerance("a", 0.2)], (), 0.0),
            RULES.stopped_velocity,
        )
        execution = DeviceTrajectory(self.axes, self.given_up, self.stops, goal, self.time_ns)
        self.mixer.advance(self.time_ns - PERIOD_NS, self.image)
        assert self.slot.submit(execution, None)
        execution.begin()
        return execution

    def step(self, seconds: float = 0.002) -> None:
        for _ in range(max(1, round(seconds * 1e9 / PERIOD_NS))):
            self.time_ns += PERIOD_NS
            self.clock.advance(PERIOD_NS / 1e9)
            self.axes.image.fresh_ns = self.clock.now_ns()
            self.axes.read(self.image)
            self.stops.look(self.image)
            self.mixer.advance(self.time_ns, self.image)

    def until(self, condition: Callable[[], bool]) -> None:
        assert wait_until(lambda: (self.step(), condition())[1], 30.0, MonotonicClock(), 1e-4)

    def called(self, name: str) -> bool:
        return any(call[0] == name for call in self.axes.calls)

    def run(self, limits: JointLimits = LIMITS) -> TrajectoryExecution:
        """Start an execution and let the device move."""
        execution = self.start(limits)
        self.until(lambda: self.called("follow"))
        self.step(0.1)
        return execution

    def arrive(self, position: float, *, complete: bool = True) -> None:
        self.axes.image.position[:] = self.axes.image.position_command[:] = position
        self.axes.image.operation[:] = Operation.IDLE
        self.axes.image.motion_complete[:] = complete


def test_sends_the_points_and_succeeds_when_the_device_has_arrived() -> None:
    harness = Harness()
    execution = harness.run()
    harness.step(1.0)
    assert not execution.done
    harness.arrive(0.5)
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.SUCCEEDED
    (name, axes, times_s, positions) = harness.axes.calls[0]
    assert (name, axes) == ("follow", [0, 1])
    np.testing.assert_allclose(times_s, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(positions, [[0.0, 0.0], [0.25, 0.25], [0.5, 0.5]])
    assert not harness.called("stop")


def test_never_streams_nor_scales_its_speed() -> None:
    harness = Harness()
    harness.axes.stream = lambda position, velocity: pytest.fail("streamed")  # type: ignore[method-assign]
    execution = harness.run()
    with pytest.raises(Unsupported, match="another speed of a running trajectory"):
        execution.override_speed(0.5)
    harness.slot.release()  # ends the execution's thread
    assert execution.done


def test_cancel_stops_the_device_and_ends_at_standstill() -> None:
    harness = Harness()
    execution = harness.run()
    harness.axes.image.velocity[:] = 1.0
    execution.cancel()
    harness.until(lambda: harness.called("stop"))
    harness.step(0.1)
    assert not execution.done
    harness.axes.image.velocity[:] = 0.0
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.CANCELED


def test_cancel_before_the_first_period_moves_nothing() -> None:
    harness = Harness()
    execution = harness.start()
    execution.cancel()
    harness.until(lambda: execution.done and harness.called("stop"))
    assert execution.outcome is Outcome.CANCELED
    assert not harness.called("follow")


def test_a_rejection_by_the_device_is_the_result() -> None:
    harness = Harness()
    harness.axes.failures["follow"] = OperationError("too many points")
    execution = harness.start()
    harness.until(lambda: execution.done)
    assert (execution.outcome, execution.message) == (Outcome.FAULT, "too many points")


def test_a_device_that_stops_by_itself_is_a_fault() -> None:
    harness = Harness()
    execution = harness.run()
    harness.arrive(0.2, complete=False)
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.FAULT
    assert "the device stopped at 0." in execution.message


def test_an_end_elsewhere_is_a_fault_that_names_joint_and_points() -> None:
    harness = Harness()
    execution = harness.run()
    harness.step(0.9)
    harness.axes.image.position[:] = harness.axes.image.position_command[:] = [0.5, 0.25]
    harness.axes.image.operation[:] = Operation.IDLE
    harness.axes.image.motion_complete[:] = True
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.FAULT
    assert "b: the device ended the trajectory at 0.2500 rad" in execution.message
    assert "its last point is 0.5000 rad at 1.000 s" in execution.message


def test_an_arrival_before_its_time_is_a_fault() -> None:
    harness = Harness()
    execution = harness.run()
    harness.step(0.5)
    harness.arrive(0.5)
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.FAULT
    assert "the device ended a trajectory of 1.000 s after 0.6" in execution.message


def test_completion_may_come_some_periods_after_the_end() -> None:
    harness = Harness()
    execution = harness.run()
    harness.step(0.9)
    harness.axes.image.operation[:] = Operation.IDLE
    harness.step(0.004)
    harness.arrive(0.5)
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.SUCCEEDED, execution.message


def test_the_measured_position_has_to_arrive_as_well() -> None:
    harness = Harness()
    execution = harness.run()
    harness.step(0.9)
    harness.arrive(0.5)
    harness.axes.image.position[1] = 0.4
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.GOAL_TOLERANCE
    assert "b" in execution.message


def test_a_slow_stop_is_waited_for() -> None:
    slow = JointLimits(NAMES, np.full(2, -3.0), np.full(2, 3.0), np.full(2, 3.0), np.full(2, 0.1))
    harness = Harness()
    execution = harness.run(slow)
    execution.cancel()
    harness.until(lambda: harness.called("stop"))
    harness.axes.image.operation[:] = Operation.STOPPING
    harness.step(3.0)
    assert not execution.done
    harness.axes.image.operation[:] = Operation.IDLE
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.CANCELED


@given(st.floats(0.0, 1.0), st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=6))
def test_a_stop_takes_as_long_as_the_limits_need_and_no_longer(
    share: float, targets: list[float]
) -> None:
    times_s = np.arange(1.0, len(targets) + 1.0) * 2.0
    request = TrajectoryRequest.from_rows(NAMES, list(times_s), [[x, -x] for x in targets])
    trajectory = plan(request, LIMITS, RULES, MotionState.at_rest(np.zeros(2)))
    from_s = share * trajectory.duration_s
    took_s = stop_time(trajectory, from_s, LIMITS)
    since_s = np.linspace(0.0, took_s, 500)
    path_s = np.minimum(from_s + since_s - since_s**2 / (2 * took_s), trajectory.duration_s)
    _, speeds, accelerations = trajectory.evaluate(path_s)
    rates = (1.0 - since_s / took_s)[:, None]
    asked = np.abs(accelerations * rates**2 - speeds / took_s).max(0)
    planned = np.abs(accelerations).max(0)
    assert (asked <= 1.25 * np.maximum(LIMITS.acceleration, planned)).all()
    speed = np.abs(trajectory.state_at(from_s).velocity).max()
    braking = float(np.abs(accelerations).max())
    if braking < 0.5 * LIMITS.acceleration[0]:
        assert took_s <= max(2.0 * speed / LIMITS.acceleration[0] * STOP_TIME_RATIO, 2e-3)


def test_an_alarm_stops_all_axes_and_names_the_joint() -> None:
    harness = Harness()
    execution = harness.run()
    harness.axes.image.amp_alarm[1], harness.axes.image.alarm_code[1] = True, 77
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.FAULT
    assert "b at" in execution.message
    assert "77" in execution.message
    assert harness.called("stop")


def test_the_following_error_is_judged_against_the_devices_command() -> None:
    harness = Harness()
    execution = harness.run()
    harness.axes.image.position_command[0] = 1.0
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.PATH_TOLERANCE
    assert harness.called("stop")


def test_a_device_that_never_arrives_is_a_fault() -> None:
    harness = Harness()
    execution = harness.run()
    harness.step(3.5)
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.FAULT
    assert "still moving" in execution.message


def test_a_path_of_length_zero_is_not_sent_to_the_device() -> None:
    harness = Harness(target=0.0)
    execution = harness.start()
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.SUCCEEDED
    assert not harness.called("follow")


def test_the_command_returns_to_a_joint_that_did_not_follow() -> None:
    harness = Harness()
    execution = harness.run()
    harness.axes.image.position_command[:] = 0.3
    harness.axes.image.position[:] = [0.05, 0.3]
    harness.axes.image.operation[:] = Operation.IDLE
    harness.until(lambda: len(harness.axes.calls) == 3)
    assert not execution.done
    name, axes, times_s, positions = harness.axes.calls[-1]
    assert (name, axes) == ("follow", [0, 1])
    np.testing.assert_allclose(positions[0], [0.3, 0.3])
    np.testing.assert_allclose(positions[-1], [0.05, 0.3])
    steps_s = np.diff(times_s)
    speeds = np.diff(positions, axis=0) / steps_s[:, None]
    assert np.abs(speeds).max() <= LIMITS.velocity[0]
    assert np.abs(np.diff(speeds, axis=0) / steps_s[1:, None]).max() <= LIMITS.acceleration[0]
    harness.axes.image.position_command[0] = 0.05
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.PATH_TOLERANCE
    assert len(harness.axes.calls) == 3


def test_a_device_that_rejects_the_return_ends_the_goal_all_the_same() -> None:
    harness = Harness()
    execution = harness.run()
    harness.axes.failures["follow"] = OperationError("not now")
    harness.axes.image.position_command[:] = 0.3
    harness.axes.image.operation[:] = Operation.IDLE
    harness.until(lambda: execution.done)
    assert execution.outcome is Outcome.PATH_TOLERANCE
