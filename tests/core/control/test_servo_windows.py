"""MoveIt Servo's windows of points in a stream: followed without stops, as by its peer."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
import yaml
from tests.core.control.harness import PERIOD_S, Harness
from tests.ros.servo_emulator import Jog, ServoEmulator, TrajectoryController, run

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_stream import JointStream
from robotd.descriptor import load_robot_descriptor
from robotd.errors import InvalidArgument
from robotd_export.export_input import ExportInput
from robotd_export.moveit import move_group_parameters

TIMEOUT_S = 0.1
BEYOND_PEER = 0.01  # rad of following error
FASTER = 1.3  # than commanded
SPEED = 0.3


class Followed:
    """Setpoints of a stream that was fed with a jog, and those of the peer at the same times."""

    def __init__(self, jog: Jog, *, delay_s: float = 0.001, until_s: float = 3.2) -> None:
        self.harness = Harness().up()
        began_ns = self.harness.clock.now_ns()
        peer = TrajectoryController((0.0, 0.0, 0.0))
        messages = list(jog.messages)
        self._peer: list[FloatArray] = []
        self.stream: JointStream | None = None
        while (now_s := (self.harness.clock.now_ns() - began_ns) / NANOSECONDS) < until_s:
            while messages and messages[0].sent_s + delay_s <= now_s:
                message = messages.pop(0)
                peer.take(message, now_s)
                if self.stream is None or not self.stream.open:
                    self.stream = self.harness.robot.stream(
                        timeout_s=TIMEOUT_S, ends_when_silent=True
                    )
                self.stream.send_points(
                    [
                        began_ns + round((message.stamp_s + time_s) * NANOSECONDS)
                        for time_s in message.times_s
                    ],
                    message.position,
                    message.velocity,
                    sent_ns=began_ns + round(message.sent_s * NANOSECONDS),
                )
            self._peer.append(np.array([now_s, *peer.at(now_s)[0]]))
            self.harness.run(PERIOD_S)
        setpoints = self.harness.setpoints
        self.due_s = setpoints.due_s - began_ns / NANOSECONDS
        self.position, self.velocity = setpoints.position, setpoints.velocity
        self.jog = jog

    @property
    def error(self) -> float:
        rows = np.column_stack([self.due_s, self.position])
        return self.jog.largest_error(rows)

    @property
    def error_of_peer(self) -> float:
        return self.jog.largest_error(np.array(self._peer))

    @property
    def rested_s(self) -> float:
        """Time from the last message to standstill."""
        moves = np.abs(self.velocity).max(axis=1) > 1e-4
        return float(self.due_s[moves].max()) - self.jog.messages[-1].sent_s


def steady(time_s: float) -> Sequence[float] | None:
    return (SPEED, -0.6 * SPEED, 0.0) if time_s < 2.0 else None


@pytest.mark.parametrize("late", [0.0, 0.7], ids=["punctual", "jittered"])
@pytest.mark.parametrize("smoothing", [False, True], ids=["raw", "smoothed"])
@pytest.mark.parametrize("period_s", [0.02, 0.01, 0.004])
def test_windows_are_followed_as_by_the_peer(period_s: float, smoothing: bool, late: float) -> None:
    servo = ServoEmulator(publish_period=period_s, use_smoothing=smoothing)
    jog = run(servo, steady, 2.5, jitter_s=late * period_s)
    followed = Followed(jog)
    assert followed.stream
    commanded = SPEED if not smoothing else SPEED / 1.75  # what is left by Servo's filter
    assert followed.error <= followed.error_of_peer + BEYOND_PEER
    assert np.abs(followed.velocity).max() <= FASTER * commanded
    assert (
        followed.velocity[:, 0].min() > -0.2 * commanded
    )  # it does not step back before it starts
    followed.harness.setpoints.assert_smooth_streams(12.0)
    assert followed.stream.message == "no command for 0.1 s"
    assert followed.stream.statistics.clipped == 0
    assert followed.position[-1] == pytest.approx(jog.states[-1, 1:], abs=1e-3)
    assert followed.rested_s < 0.2


def test_servo_is_followed_with_the_exported_configuration() -> None:
    text = move_group_parameters(ExportInput(load_robot_descriptor("cr3a")))
    servo = yaml.safe_load(text)["/**"]["ros__parameters"]["moveit_servo"]
    assert servo["publish_joint_positions"]
    assert servo["publish_joint_velocities"]
    periods = {key: servo[key] for key in ("publish_period", "max_expected_latency")}
    followed = Followed(run(ServoEmulator(**periods), steady, 2.5))
    assert followed.error <= followed.error_of_peer + BEYOND_PEER


@pytest.mark.parametrize("latency_s", [0.03, 0.05, 0.25])
def test_short_and_long_windows(latency_s: float) -> None:
    servo = ServoEmulator(use_smoothing=False, max_expected_latency=latency_s)
    followed = Followed(run(servo, steady, 2.5, jitter_s=0.003))
    assert followed.error <= followed.error_of_peer + 0.012
    assert np.abs(followed.velocity).max() <= FASTER * SPEED


@pytest.mark.parametrize("delay_s", [0.02, 0.04])
def test_windows_that_arrive_late(delay_s: float) -> None:
    followed = Followed(run(ServoEmulator(use_smoothing=False), steady, 2.5), delay_s=delay_s)
    assert followed.error <= followed.error_of_peer + BEYOND_PEER
    assert np.abs(followed.velocity).max() <= FASTER * SPEED


def test_messages_that_end_in_motion_stop_the_joints_by_the_time_out() -> None:
    jog = run(ServoEmulator(use_smoothing=False), lambda _: (SPEED, SPEED, SPEED), 1.5)
    followed = Followed(jog)
    assert jog.messages[-1].velocity[-1] == pytest.approx(SPEED)
    assert followed.rested_s < TIMEOUT_S + 0.1  # and the ramp
    assert followed.position[-1, 0] - jog.states[-1, 1] < SPEED * TIMEOUT_S
    followed.harness.setpoints.assert_smooth_streams(12.0)


@pytest.mark.parametrize(
    "scale",
    [
        lambda time_s: max(0.0, 1.0 - max(0.0, time_s - 1.0) / 0.3),
        lambda time_s: float(time_s < 1.0),
        lambda time_s: 1.0 if time_s < 1.0 else -1.0,
        lambda time_s: math.sin(4.0 * time_s),
    ],
    ids=["singularity", "halt", "reversal", "sine"],
)
def test_motion_that_slows_stops_and_turns(scale: object) -> None:
    def velocity(time_s: float) -> Sequence[float] | None:
        return (SPEED * scale(time_s),) * 3 if time_s < 2.0 else None  # type: ignore[operator]

    followed = Followed(run(ServoEmulator(use_smoothing=False), velocity, 2.5, jitter_s=0.003))
    assert followed.error <= followed.error_of_peer + BEYOND_PEER
    assert np.abs(followed.velocity).max() <= FASTER * SPEED
    assert followed.position[-1] == pytest.approx(followed.jog.states[-1, 1:], abs=1e-3)


def test_the_joints_stay_within_their_limits_where_windows_lead_out() -> None:
    def fast(time_s: float) -> Sequence[float]:
        return (5.0, 0.0, 0.0)

    followed = Followed(run(ServoEmulator(use_smoothing=False), fast, 2.0))
    assert followed.stream
    assert followed.position.max() <= 3.0 + 1e-6
    assert followed.velocity.max() <= 3.0 * 1.001
    assert followed.stream.statistics.clipped > 0
    followed.harness.setpoints.assert_smooth_streams(12.0)


def test_a_stall_of_the_control_loop_is_made_up_for_within_the_limits() -> None:
    harness = Harness().up()
    with harness.robot.stream(timeout_s=1.0) as stream:
        began_ns = harness.clock.now_ns()
        times_ns = [began_ns + step * 10_000_000 for step in range(1, 101)]
        position = [[0.003 * step, 0.0, 0.0] for step in range(1, 101)]
        stream.send_points(times_ns, position, [[SPEED, 0.0, 0.0]] * 100)
        harness.run(0.4)
        harness.stall(0.03)
        harness.run(0.4)
    velocity = harness.setpoints.velocity
    assert velocity[:, 0].max() <= FASTER * SPEED
    assert harness.setpoints.position[200:400, 0].max() == pytest.approx(0.24, abs=0.01)


def test_points_without_velocities_end_at_rest() -> None:
    harness = Harness().up()
    with harness.robot.stream(["joint2"], timeout_s=0.5) as stream:
        now_ns = harness.clock.now_ns()
        times_ns = [now_ns + step * 50_000_000 for step in range(1, 11)]
        stream.send_points(times_ns, [[0.01 * step] for step in range(1, 11)])
        harness.run(0.9)
        assert harness.setpoints.position[-1] == pytest.approx([0.0, 0.1, 0.0], abs=1e-4)
        assert harness.setpoints.velocity[:, 1].max() < 0.3


@pytest.mark.parametrize(
    ("times_ns", "position", "velocity", "text"),
    [
        ([], [], None, "there must be one"),
        ([20, 20], [[0.0] * 3] * 2, None, "must increase"),
        ([10, 20], [[0.0] * 3], None, "1 points for 2 times"),
        ([10, 20], [[0.0] * 3, [0.0] * 2], None, "2 values for 3 joints"),
        ([10], [[0.0, math.inf, 0.0]], None, "joint2: position is inf"),
        ([10], [[0.0] * 3], [[0.0, 0.0, math.nan]], "joint3: velocity is nan"),
    ],
)
def test_wrong_points_are_rejected(
    times_ns: list[int], position: object, velocity: object, text: str
) -> None:
    harness = Harness().up()
    with (
        harness.robot.stream() as stream,
        pytest.raises(InvalidArgument, match=text),
    ):
        stream.send_points(times_ns, position, velocity)  # type: ignore[arg-type]
    with (
        harness.robot.stream(mode="smooth") as stream,
        pytest.raises(InvalidArgument, match="takes positions only"),
    ):
        stream.send_points([10], [[0.0] * 3])
