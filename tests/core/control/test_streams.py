"""Streams: motion that a client decides while it happens, on the simulation."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from types import FrameType
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import ACCELERATION, PERIOD_S, Harness, arm

from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_stream import JointStream
from robotd.control.groups.streams import OpenStream
from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Axes
from robotd.device.process_image import ProcessImage
from robotd.device.state import EXTRAPOLATION_PERIODS, Operation
from robotd.errors import InvalidArgument, NotReady, Unsupported
from robotd.motion import TrajectoryRejected

ANGULAR = 2.0 * math.pi * 0.4
WAIT_S = 10.0


@pytest.fixture
def robot() -> Iterator[Harness]:
    harness = Harness().up()
    yield harness
    harness.robot.shutdown()


def send_sine(robot: Harness, stream: JointStream, seconds: float, rate_hz: float = 30.0) -> None:
    for index in range(round(seconds * rate_hz)):
        stream.send([0.4 * math.sin(ANGULAR * index / rate_hz)] * len(stream.joints))
        robot.run(1.0 / rate_hz)


@pytest.mark.parametrize("mode", ["target", "smooth"])
def test_targets_at_30_hz_are_followed_smoothly(robot: Harness, mode: str) -> None:
    with robot.robot.stream(mode=mode) as stream:
        send_sine(robot, stream, 5.0)
        robot.run(0.1)
        expected = 0.4 * math.sin(ANGULAR * (5.0 - 1 / 30.0))
        assert robot.image.position == pytest.approx([expected] * 3, abs=0.05)
        assert stream.statistics.commands == 150
    robot.setpoints.assert_smooth(ACCELERATION)
    assert stream.message == "closed by the client"


def test_a_stream_needs_known_commands(robot: Harness) -> None:
    driver = robot.robot.control_loop._driver
    read = driver.read

    def read_partly(image: ProcessImage) -> None:
        read(image)
        image.position_command[1] = math.nan

    driver.read = read_partly  # type: ignore[method-assign]
    robot.run(PERIOD_S)
    with pytest.raises(NotReady, match="joint2: the present position is not known"):
        robot.robot.stream()
    robot.run(0.1)
    assert not robot.setpoints.rows


def test_a_stream_does_not_begin_where_values_froze_that_are_older_than_the_last_one(
    robot: Harness,
) -> None:
    robot.faults.freeze(True)
    with robot.robot.stream() as stream:
        stream.send_velocity([0.1] * 3)
        robot.run(0.02)  # it is at rest again before the values count as stale
    end = robot.setpoints.rows[-1][1]
    with pytest.raises(NotReady):
        robot.robot.stream()
    robot.faults.freeze(False)
    robot.robot.recover()
    assert robot.image.position_command[:3] == pytest.approx(end)
    with robot.robot.stream():
        robot.run(PERIOD_S)
    robot.setpoints.assert_smooth_streams(ACCELERATION)


@pytest.mark.parametrize(("mode", "velocity"), [("smooth", None), ("target", [0.0])])
def test_a_stream_of_one_joint_moves_it_and_no_other(
    robot: Harness, mode: str, velocity: list[float] | None
) -> None:
    with robot.robot.stream(["joint2"], mode=mode) as stream:
        for index in range(31):
            stream.send([0.01 * index], velocity)
            robot.run(1.0 / 30.0)
        robot.run(0.3)
    assert robot.image.position == pytest.approx([0.0, 0.3, 0.0], abs=1e-3)
    robot.setpoints.assert_smooth(ACCELERATION)


def test_a_velocity_with_the_position_leaves_no_lag(robot: Harness) -> None:
    with robot.robot.stream() as stream:
        for index in range(200):
            time_s = index * 0.01
            stream.send(
                [0.4 * math.sin(ANGULAR * time_s)] * 3,
                [0.4 * ANGULAR * math.cos(ANGULAR * time_s)] * 3,
            )
            robot.run(0.01)
        expected = 0.4 * math.sin(
            ANGULAR * robot.setpoints.due_s[-1] - ANGULAR * (robot.now_s - 2.0)
        )
        assert robot.setpoints.position[-1] == pytest.approx([expected] * 3, abs=2e-3)
    robot.setpoints.assert_smooth(ACCELERATION)


def test_the_joints_belong_to_the_stream_until_it_is_closed(robot: Harness) -> None:
    axes = robot.robot.axes
    with robot.robot.stream(owner="policy"):
        assert [axes.owner(axis) for axis in range(3)] == ["policy"] * 3
        with pytest.raises(NotReady, match="joint1: in use by policy"):
            robot.move(0, 0.1)
    assert axes.owner(0) == ""
    robot.run(0.1)
    assert robot.axes_in(Operation.STREAM) == []


def test_two_threads_that_close_a_stream_give_the_joints_back_once(robot: Harness) -> None:
    stream, released = robot.robot.stream(), list[object]()
    release, stream._release = stream._release, released.append
    entered, may_go_on, lines = threading.Event(), threading.Event(), list[int]()

    def interrupt(frame: FrameType, event: str, argument: object) -> Any:
        if frame.f_code is not OpenStream.close.__code__:
            return None
        lines.extend([frame.f_lineno] * (event == "line"))
        if len(lines) == 2:  # after the first line
            entered.set()
            may_go_on.wait(WAIT_S)
        return interrupt

    def close() -> None:
        sys.settrace(interrupt)
        stream.close()

    first = threading.Thread(target=close)
    first.start()
    assert entered.wait(WAIT_S)
    stream.close()
    may_go_on.set()
    first.join(WAIT_S)
    assert released == [stream._motion]
    release(stream._motion)


def test_without_commands_the_joints_slow_to_rest_and_the_next_one_continues(
    robot: Harness,
) -> None:
    with robot.robot.stream(timeout_s=0.05) as stream:
        for _ in range(10):
            stream.send([2.0] * 3)
            robot.run(1 / 30)
        assert np.abs(robot.setpoints.velocity[-1]).max() > 0.1
        robot.run(0.8)
        assert np.abs(robot.setpoints.velocity[-1]).max() == pytest.approx(0.0, abs=1e-9)
        assert stream.statistics.timeouts == 1
        assert 0.1 < robot.setpoints.position[-1, 0] < 1.9
        for _ in range(60):
            stream.send([2.0] * 3)
            robot.run(1 / 30)
        assert robot.setpoints.position[-1] == pytest.approx([2.0] * 3)
        assert stream.open
    robot.setpoints.assert_smooth(ACCELERATION)


def test_a_stream_that_ends_when_silent_gives_a_reason(robot: Harness) -> None:
    stream = robot.robot.stream(timeout_s=0.05, ends_when_silent=True)
    stream.send_velocity([0.5, 0.0, -0.5])
    robot.until(lambda: not stream.open)
    robot.run(0.5)
    assert stream.message == "no command for 0.05 s"
    with pytest.raises(NotReady, match=r"the stream has ended: no command for 0\.05 s"):
        stream.send([0.0] * 3)
    stream.close()


def test_a_stream_takes_over_from_a_goal_in_motion_and_hands_over_to_the_next(
    robot: Harness,
) -> None:
    with robot.goal([2.0, 1.0, -1.0], seconds=2.0) as first:
        robot.run(1.0)
        with robot.robot.stream(takeover=True, mode="smooth") as stream:
            begin = robot.setpoints.position[-1]
            rate = robot.setpoints.velocity[-1]
            for index in range(30):
                stream.send((begin + rate * (index + 2) / 30.0).tolist())
                robot.run(1 / 30.0)
            assert first.outcome is Outcome.PREEMPTED
            with pytest.raises(NotReady, match="joint1: in use by stream"), robot.goal([0.0] * 3):
                pass
            streamed = len(robot.setpoints.rows)
    robot.setpoints.assert_smooth(ACCELERATION)
    assert np.abs(robot.setpoints.velocity[400:streamed, 0]).min() > 0.3


def test_a_goal_takes_over_from_a_stream_in_motion_where_the_descriptor_allows_it() -> None:
    robot = Harness(arm(stream={"takeover": True})).up()
    with robot.robot.stream() as stream:
        for index in range(30):
            stream.send([0.02 * index + 0.05] * 3)
            robot.run(1 / 30.0)
        moving = len(robot.setpoints.rows)
        with robot.goal([2.0] * 3, seconds=2.0) as goal:
            robot.end(goal)
            assert goal.outcome is Outcome.SUCCEEDED
            assert not stream.open
            with pytest.raises(NotReady, match="preempted"):
                stream.send([0.0] * 3)
    taken = robot.setpoints.velocity[moving : moving + 500, 0]
    assert taken.min() > 0.1, "came to a standstill"
    robot.setpoints.assert_smooth(ACCELERATION)
    robot.robot.shutdown()


@pytest.mark.parametrize(("mode", "velocity"), [("smooth", None), ("target", [0.4, 0.0, -0.3])])
def test_a_rejected_goal_does_not_change_the_start_of_one_that_waits(
    mode: str, velocity: list[float] | None
) -> None:
    robot = Harness(arm(stream={"takeover": True})).up()
    with robot.robot.stream(mode=mode) as stream:
        for step in range(20):
            stream.send([0.03 * step, 0.0, -0.03 * step], velocity)
            robot.run(0.03)
        stream.send([1.5, 0.0, -1.5], velocity)
        robot.run(0.03)
        with robot.goal((1.0, 0.2, 0.0), seconds=2.5) as goal:
            robot.run(0.004)
            with pytest.raises(TrajectoryRejected), robot.goal((0.5, 9.0, 0.0)):
                pass
            robot.end(goal)
    assert goal.outcome is Outcome.SUCCEEDED
    robot.setpoints.assert_smooth(1.2 * ACCELERATION)


def test_a_rejected_goal_lets_no_command_pass_before_the_one_that_waits() -> None:
    robot = Harness(arm(stream={"takeover": True})).up()
    with robot.robot.stream() as stream, robot.goal([0.5] * 3, start_in_s=1.0) as goal:
        with pytest.raises(TrajectoryRejected), robot.goal((0.5, 9.0, 0.0)):
            pass
        for index in range(8):
            stream.send([-0.05 * index] * 3)
            robot.run(0.1)
        robot.end(goal)
    assert goal.outcome is Outcome.SUCCEEDED
    robot.setpoints.assert_smooth(ACCELERATION)


@pytest.mark.parametrize("target", [(0.5, 9.0, 0.0), (0.5, 0.5, 0.5)])
def test_a_stream_goes_on_when_no_goal_takes_over(target: tuple[float, float, float]) -> None:
    """It was rejected, or canceled before its start."""
    robot = Harness(arm(stream={"takeover": True})).up()
    with robot.robot.stream() as stream:
        with suppress(TrajectoryRejected), robot.goal(target, start_in_s=60.0):
            pass
        for _ in range(10):
            stream.send([0.2] * 3)
            robot.run(0.05)
        assert robot.image.position == pytest.approx([0.2] * 3, abs=1e-3)
    robot.setpoints.assert_smooth(ACCELERATION)


def test_commands_wait_for_a_goal_that_is_planned_before_the_first_period() -> None:
    robot = Harness(arm(stream={"takeover": True})).up()
    with robot.robot.stream() as stream, robot.goal((1.0, -0.5, 0.0), seconds=2.0) as goal:
        stream.send_velocity([1.5, -1.0, 0.0])
        robot.end(goal)
    assert goal.outcome is Outcome.SUCCEEDED
    robot.setpoints.assert_smooth(ACCELERATION)


@pytest.mark.parametrize("stall_s", [0.004, 0.01, 0.015])
def test_after_a_stall_a_goal_takes_over_from_where_the_stream_is(stall_s: float) -> None:
    robot = Harness(arm(stream={"takeover": True})).up()
    with robot.robot.stream() as stream:
        stream.send_velocity([1.5, -1.0, 0.0])
        robot.run(0.2)
        with robot.goal((1.0, -0.5, 0.0), seconds=2.0) as goal:
            robot.run(0.004)
            robot.stall(stall_s)
            robot.end(goal)
    assert goal.outcome is Outcome.SUCCEEDED
    setpoints = robot.setpoints
    velocity, elapsed_s = setpoints.velocity, np.diff(setpoints.due_s)[:, None]
    assert np.diff(setpoints.due_s).max() > stall_s, "no underrun"
    mean = (velocity[:-1] + velocity[1:]) / 2
    # In the underrun the device goes on with the velocity that it has, and then holds.
    holds = elapsed_s > 2.5 * PERIOD_S
    assert holds.sum() == 1
    before = np.where(holds, 0.0, velocity[:-1])
    assert np.abs(velocity[1:] - before).max() <= 2.1 * ACCELERATION * PERIOD_S
    expected = np.where(holds, 1.5 * PERIOD_S * velocity[:-1], mean * elapsed_s)
    off = np.diff(setpoints.position, axis=0) - expected
    assert np.abs(off).max() <= 2.1 * ACCELERATION * PERIOD_S**2


def test_joints_of_another_owner_are_rejected_by_its_name(robot: Harness) -> None:
    with robot.goal([1.0] * 3, seconds=2.0):
        robot.run(0.5)
        with pytest.raises(NotReady, match="joint1: in use by trajectory"):
            robot.robot.stream()


def test_joints_that_are_not_streamed_hold(robot: Harness) -> None:
    with robot.robot.stream(["joint3", "joint1"]) as stream:
        assert stream.joints == ("joint3", "joint1")
        for _ in range(30):
            stream.send([0.2, -0.1])
            robot.run(1 / 30.0)
    assert robot.setpoints.position[-1] == pytest.approx([-0.1, 0.0, 0.2])


def test_what_is_beyond_a_limit_is_clipped_and_counted(robot: Harness) -> None:
    with robot.robot.stream() as stream:
        for _ in range(90):
            stream.send([5.0, 0.0, 0.0])
            robot.run(1 / 30.0)
        assert stream.statistics.clipped == 90
        assert robot.setpoints.position[-1] == pytest.approx([3.0, 0.0, 0.0])
        stream.send_velocity([9.0, 0.0, 0.0])
        assert stream.statistics.clipped == 91


def test_a_stream_keeps_to_a_lower_velocity_of_its_client(robot: Harness) -> None:
    with robot.robot.stream(["joint2"], max_velocity=[0.2], timeout_s=9.0) as stream:
        stream.send([0.5])
        robot.run(1.0)
        assert robot.setpoints.velocity[:, 1].max() == pytest.approx(0.2)
        stream.send_velocity([2.0])
        robot.run(1.0)
        assert stream.statistics.clipped == 1
        assert robot.setpoints.velocity[:, 1].max() == pytest.approx(0.2)


def test_a_velocity_command_ends_at_rest_at_the_position_limit(robot: Harness) -> None:
    with robot.robot.stream() as stream:
        for _ in range(60):
            stream.send_velocity([3.0, -1.0, 0.0])
            robot.run(1 / 30.0)
    position = robot.setpoints.position
    assert position.max() <= 3.0 + 1e-6
    assert position[-1, 0] == pytest.approx(3.0, abs=1e-6)
    robot.setpoints.assert_smooth(ACCELERATION)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([0.0, 0.0], "position: 2 values for 3 joints (joint1, joint2, joint3)"),
        ([0.0, math.nan, 0.0], "joint2: position is nan, must be a finite number"),
        ([0.0, 0.0, -math.inf], "joint3: position is -inf, must be a finite number"),
    ],
)
def test_wrong_values_are_rejected(robot: Harness, values: list[float], message: str) -> None:
    with robot.robot.stream() as stream, pytest.raises(InvalidArgument) as error:
        stream.send(values)
    assert message in str(error.value)


def test_wrong_arguments_are_rejected(robot: Harness) -> None:
    stream = robot.robot.stream
    for message, arguments in {
        "joint elbow is unknown (available: joint1, joint2, joint3)": {"joints": ["elbow"]},
        "a joint is given twice: joint1, joint1": {"joints": ["joint1", "joint1"]},
        "no joint given": {"joints": []},
        "mode 'fast' is unknown (available: target, smooth)": {"mode": "fast"},
        "timeout_s is 0.0, must be a positive number": {"timeout_s": 0.0},
        "max_velocity is [0.0], must be a positive number": {
            "joints": ["joint1"],
            "max_velocity": [0.0],
        },
        "for each of 3 joints": {"max_velocity": [1.0]},
    }.items():
        with pytest.raises(InvalidArgument) as error:
            stream(**arguments)  # type: ignore[arg-type]
        assert message in str(error.value)
    with stream(mode="smooth") as smooth, pytest.raises(InvalidArgument, match="positions only"):
        smooth.send([0.0] * 3, [0.0] * 3)


def test_a_drive_fault_ends_the_stream_with_its_reason(robot: Harness) -> None:
    with robot.robot.stream() as stream:
        stream.send([1.0] * 3)
        robot.run(0.05)
        robot.faults.trip(1, 17)
        robot.until(lambda: not stream.open)
        robot.run(0.5)
        assert "joint2" in stream.message
        assert "alarm 17" in stream.message
        assert np.abs(robot.image.velocity).max() < 0.01


@pytest.mark.parametrize("stall_s", [PERIOD_S, 0.03])
def test_after_a_stall_the_joints_continue_from_where_they_are(
    robot: Harness, stall_s: float
) -> None:
    with robot.robot.stream(timeout_s=1.0) as stream:
        stream.send_velocity([0.5, 0.5, 0.5])
        robot.run(0.5)
        before = len(robot.setpoints.rows)
        robot.stall(stall_s)
        robot.run(0.2)
    position, velocity = robot.setpoints.position[:, 0], robot.setpoints.velocity[:, 0]
    gap = position[before] - position[before - 1]
    if stall_s == PERIOD_S:
        assert gap == pytest.approx(0.5 * 2 * PERIOD_S, abs=1e-5)
        assert velocity[before : before + 80] == pytest.approx(0.5, abs=1e-3)
    else:  # the device is at rest, where one setpoint more has led it
        assert gap == pytest.approx(0.5 * 1.5 * PERIOD_S, abs=1e-4)
        steps = np.diff(velocity[before : before + 80])
        assert 0.0 <= velocity[before] <= 2.1 * ACCELERATION * PERIOD_S
        assert -1e-9 <= steps.min() < steps.max() <= 2.1 * ACCELERATION * PERIOD_S
        assert velocity[before + 80] == pytest.approx(0.5)


@pytest.mark.parametrize("stall_s", [0.1, 0.2])
def test_a_starved_control_loop_keeps_the_joints_within_their_limits(
    robot: Harness, stall_s: float
) -> None:
    """They went on with the last velocity: from -0.27 to 8.52 rad, of -3 to 3."""
    with robot.robot.stream(timeout_s=1.0) as stream:
        commands = []
        for target in (2.0, 2.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0):
            stream.send([target] * 3)
            robot.run(0.33)
            _, position, velocity = robot.setpoints.rows[-1]
            robot.stall(stall_s)
            with robot.simulation.world.lock:
                robot.simulation.world.advance()
                commands.append(robot.simulation.servo.command.copy())
            held = position + EXTRAPOLATION_PERIODS * PERIOD_S * velocity
            assert commands[-1] == pytest.approx(held, abs=1e-6), "the drives hold"
        assert stream.open
    places = np.concatenate([robot.setpoints.position, commands])
    assert places.max() > 1.5, "they move"
    assert places.max() < 2.0 + 0.01
    assert places.min() > -0.01


def test_a_device_that_interpolates_trajectories_streams_nothing(
    robot: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Axes, "trajectories_on_device", True)
    with pytest.raises(Unsupported, match="streamed positions"):
        robot.robot.stream()


def test_a_lost_device_ends_the_stream(robot: Harness) -> None:
    with robot.robot.stream() as stream:
        stream.send([1.0] * 3)
        robot.run(0.2)
        robot.connection.stop_communication()
        robot.until(lambda: not stream.open)
        assert stream.message


def test_a_command_of_a_time_to_come_does_not_put_its_time_out_off(robot: Harness) -> None:
    with robot.robot.stream(timeout_s=0.05) as stream:
        in_an_hour_ns = robot.robot.clock.now_ns() + 3600 * NANOSECONDS
        stream.send_velocity([0.3, 0.0, 0.0], sent_ns=in_an_hour_ns)
        robot.run(0.5)
        assert stream.statistics.timeouts == 1
        assert robot.setpoints.velocity[-1] == pytest.approx([0.0] * 3, abs=1e-9)
