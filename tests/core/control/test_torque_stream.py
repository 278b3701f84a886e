"""Torque streams without a device: ends, limits, and rejected requests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.core.control.harness import PERIOD_S, Harness, arm
from tests.fakes import FakeAxes, FakeClock

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_motion import JointMotion
from robotd.control.groups.torque_stream import TorqueStreams
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.joint_source import REST_TIMEOUT_S
from robotd.control.sources.torque_source import TorqueMotion
from robotd.device.axis_stops import AxisStops
from robotd.device.motion_limits import MotionLimits
from robotd.device.speed_scale import SpeedScale
from robotd.device.state import CommandMode, Operation
from robotd.errors import InvalidArgument, NotReady, OperationError, Unsupported
from robotd.motion import JointLimits

PERIOD_NS, TIMEOUT_S = 4_000_000, 0.1
AXIS_NAMES = ("elbow", "bare", "shoulder")
AXES = np.array([2, 0])  # in another order than the device's


class TorqueAxes(FakeAxes):
    """Records torques; a stop is recorded, and the test decides when the axes are at rest."""

    def __init__(self) -> None:
        super().__init__(3)
        self.torques: list[list[float]] = []
        self.image.servo_on[:] = True
        self.image.operation[AXES] = Operation.STREAM

    def stream_torque(self, torque: FloatArray, due_ns: int) -> None:
        self.torques.append(torque.tolist())

    def stop(self, axes: Sequence[int]) -> None:
        self.record("stop", list(axes))
        self.image.operation[list(axes)] = Operation.STOPPING


def robot_axes(driver: TorqueAxes, speed: SpeedScale, stops: AxisStops) -> Any:
    return SimpleNamespace(stops=stops, speed=speed, feedback_period_s=0.0, response_s=0.0)


class Rig:
    """A torque motion of two joints, advanced period by period."""

    def __init__(self) -> None:
        self.axes, self.speed, self.time_ns = TorqueAxes(), SpeedScale(), NANOSECONDS
        self.motion_limits, self.clock = MotionLimits(), FakeClock()
        self.stops = AxisStops(
            self.axes, self.axes.image, lambda: True, AXIS_NAMES, self.clock, 0.1, 3.0
        )
        limits = JointLimits(
            ("shoulder", "elbow"),
            np.array([-1.0, -1.0]),
            np.array([1.0, 1.0]),
            np.array([2.0, 2.0]),
            np.array([10.0, 10.0]),
        )
        stopped = np.array([0.01, 0.01])
        self.motion = TorqueMotion(
            self.axes,
            robot_axes(self.axes, self.speed, self.stops),
            AXES,
            limits,
            self.time_ns,
            TIMEOUT_S,
            stopped,
            self.motion_limits,
        )

    @property
    def image(self) -> Any:
        return self.axes.image

    def put(self, *torque: float) -> None:
        self.motion.put(np.array(torque), self.time_ns)

    def run(self, periods: int = 1) -> None:
        for _ in range(periods):
            self.time_ns += PERIOD_NS
            assert self.motion.advance(self.time_ns, PERIOD_NS, self.image) is False

    def stopped(self) -> list[Any]:
        return [call for call in self.axes.calls if call[0] == "stop"]


def test_the_torque_is_unchanged_until_the_first_command() -> None:
    rig = Rig()
    rig.run()
    assert np.isnan(rig.axes.torques[-1]).all()
    rig.put(4.0, -5.0)
    rig.run()
    torque = rig.axes.torques[-1]
    assert (torque[2], torque[0]) == (4.0, -5.0)
    assert np.isnan(torque[1])


def test_without_a_command_the_drives_stop_and_the_stream_ends_at_rest() -> None:
    rig = Rig()
    rig.put(4.0, 0.0)
    rig.run(int(TIMEOUT_S * NANOSECONDS / PERIOD_NS))
    assert rig.motion.completion.requested is None
    rig.image.velocity[2] = 0.5
    rig.run(2)
    assert rig.stopped() == [("stop", [0, 2])]
    sent = len(rig.axes.torques)
    rig.run(10)
    assert not rig.motion.completion.done
    rig.image.velocity[2] = 0.0
    rig.run(3)
    assert rig.motion.completion.outcome is Outcome.SUCCEEDED
    assert rig.motion.completion.message == "no command for 0.1 s"
    assert len(rig.axes.torques) == sent, "no torque after the stop"
    assert len(rig.stopped()) == 1


def test_a_joint_that_does_not_come_to_rest_is_reported() -> None:
    rig = Rig()
    rig.motion.completion.request(Outcome.CANCELED, "canceled by the client")
    rig.image.velocity[2] = 0.5
    rig.run(int(REST_TIMEOUT_S * NANOSECONDS / PERIOD_NS) + 3)
    assert rig.motion.completion.message == "canceled by the client; joints still move"


@pytest.mark.parametrize(
    ("position", "velocity", "reason"),
    [
        (0.0, 2.1, "elbow: 2.1 rad/s, its velocity limit is 2 rad/s"),
        (0.0, float("nan"), "elbow: nan rad/s, its velocity limit is 2 rad/s"),
        (0.9, 1.5, "elbow: at 0.9 rad, too close to its limit 1 rad"),
        (-0.9, -1.5, "elbow: at -0.9 rad, too close to its limit -1 rad"),
        (1.01, 0.0, "elbow: at 1.01 rad, too close to its limit"),
    ],
)
def test_a_limit_ends_it(position: float, velocity: float, reason: str) -> None:
    rig = Rig()
    rig.run()
    rig.image.position[0], rig.image.velocity[0] = position, velocity
    rig.run()
    assert rig.stopped() == [("stop", [0, 2])]
    assert rig.motion.completion.requested is not None
    assert rig.motion.completion.requested[0] is Outcome.STOPPED
    assert reason in rig.motion.completion.requested[1]


def test_a_joint_with_room_to_brake_goes_on() -> None:
    rig = Rig()
    rig.image.position[0], rig.image.velocity[0] = 0.9, -1.5
    rig.run(3)
    assert rig.motion.completion.requested is None


def test_a_fault_and_the_speed_of_the_operator_end_it() -> None:
    rig = Rig()
    rig.run()
    rig.image.amp_alarm[2] = True
    rig.run()
    assert rig.motion.completion.requested is not None
    assert rig.motion.completion.requested[0] is Outcome.FAULT
    assert "shoulder at" in rig.motion.completion.requested[1]
    rig = Rig()
    rig.run()
    rig.speed.pause()
    rig.run()
    assert rig.motion.completion.requested == (Outcome.STOPPED, "motion is paused (100 %)")


def test_the_speed_scales_the_velocity_limit() -> None:
    rig = Rig()
    rig.speed.set(0.5)
    rig.image.velocity[2] = 0.9
    rig.run()
    assert rig.motion.completion.requested is None
    rig.image.velocity[2] = 1.1  # of 2 rad/s
    rig.run()
    assert rig.motion.completion.requested is not None
    assert rig.motion.completion.requested[1] == (
        "shoulder: 1.1 rad/s, its velocity limit at a speed of 50 % is 1 rad/s"
    )


@pytest.mark.parametrize(
    ("velocity", "torque", "left"),
    [(0.7, 4.0, 4.0), (0.9, 4.0, 2.0), (1.0, 4.0, 0.0), (0.95, -4.0, -4.0), (-0.9, -4.0, -2.0)],
)
def test_below_full_speed_a_torque_that_drives_on_fades(
    velocity: float, torque: float, left: float
) -> None:
    rig = Rig()
    rig.speed.set(0.5)
    rig.image.velocity[2] = velocity
    rig.put(torque, 1.0)
    rig.run()
    assert rig.axes.torques[-1][2] == pytest.approx(left)
    assert rig.axes.torques[-1][0] == 1.0
    rig.speed.set(1.0)
    rig.run()
    assert rig.axes.torques[-1][2] == torque


def test_a_busy_device_stops_in_the_end() -> None:
    rig = Rig()
    rig.axes.failures["stop"] = OperationError("busy")
    rig.motion.completion.request(Outcome.CANCELED, "canceled by the client")
    rig.run()
    assert rig.image.operation[2] == Operation.STREAM
    del rig.axes.failures["stop"]
    for _ in range(30):
        rig.clock.advance(0.01)
        rig.stops.look(rig.image)
    assert rig.image.operation[2] == Operation.STOPPING


def test_nothing_continues_it() -> None:
    rig = Rig()
    assert rig.motion.splice_state(rig.time_ns) is None
    rig.motion.sent(1)
    rig.motion.take_over(rig.motion, 0, 1)
    assert rig.motion.start_ns == NANOSECONDS


class Joints:
    """Stands for ``JointMotion``: makes the source at once."""

    def __init__(self) -> None:
        self.claims: list[tuple[list[int], CommandMode, str]] = []
        self.released: list[TorqueMotion] = []

    def start_alone(
        self,
        axes: list[int],
        mode: CommandMode,
        make: Callable[[int], TorqueMotion],
        owner: str,
    ) -> TorqueMotion:
        self.claims.append((axes, mode, owner))
        return make(0)

    def release(self, motion: TorqueMotion) -> None:
        self.released.append(motion)


@pytest.fixture
def harness() -> Harness:
    descriptor = arm()
    joints = [
        joint.model_copy(update={"torque_limit_nm": 5.0 if joint.axis else None})
        for joint in descriptor.joints
    ]
    return Harness(descriptor.model_copy(update={"joints": tuple(joints)})).up()


def streams(harness: Harness, joints: Any) -> TorqueStreams:
    robot = harness.robot
    return TorqueStreams(
        joints,
        robot.follower.limits,
        robot.follower.rules,
        robot.groups.only.motion_limits,
        robot.axes,
        robot.rearming,
        robot.descriptor,
        TorqueAxes(),
    )


def test_torques_are_clipped_counted_and_ended(harness: Harness) -> None:
    joints = Joints()
    with streams(harness, joints)(["joint3", "joint2"], owner="policy") as stream:
        assert joints.claims == [([2, 1], CommandMode.TORQUE, "policy")]
        stream.send([9.0, -4.0])
        command = stream._motion._command[1]
        assert command is not None
        assert command.tolist() == [5.0, -4.0]
        assert stream.clipped == 1
        for wrong in ([1.0], [1.0, float("inf")]):
            with pytest.raises(InvalidArgument, match="torque"):
                stream.send(wrong)
        assert stream.open
        assert not stream.wait(0.0)
    assert joints.released == [stream._motion]
    with pytest.raises(NotReady, match="the stream has ended: closed by the client"):
        stream.send([0.0, 0.0])


@pytest.mark.parametrize(
    ("joints", "timeout_s", "reason"),
    [
        (["joint1"], None, r"joint1: no torque limit; .* joints\.0\.torque_limit_nm"),
        (["hip"], None, "joint hip is unknown"),
        (["joint2", "joint2"], None, "given twice"),
        ([], None, "no joint given"),
        (["joint2"], 0.0, "timeout_s is 0.0"),
    ],
)
def test_a_wrong_request_is_rejected(
    harness: Harness, joints: list[str], timeout_s: float | None, reason: str
) -> None:
    fake = Joints()
    with pytest.raises(InvalidArgument, match=reason):
        streams(harness, fake)(joints, timeout_s=timeout_s)
    assert fake.claims == []


def test_a_paused_robot_takes_no_torque(harness: Harness) -> None:
    harness.robot.axes.speed.pause()
    with pytest.raises(NotReady, match="motion is paused"):
        streams(harness, Joints())(["joint2"])


def test_a_speed_limit_ends_torques_and_takes_none(harness: Harness) -> None:
    rig, reduced = Rig(), "reduced speed: at most 0.25 m/s"
    rig.put(4.0, 0.0)
    rig.run()
    for limit in (rig.motion_limits, harness.robot.groups.only.motion_limits):
        limit.set_speed(lambda _, velocities: np.ones(len(velocities)), reduced, "")
    rig.run()
    assert rig.motion.completion.requested == (Outcome.STOPPED, reduced)
    with pytest.raises(NotReady, match=f"{reduced}; torques cannot keep it"):
        streams(harness, Joints())(["joint2"])


def test_a_backend_without_torques_says_so_and_frees_the_joints(harness: Harness) -> None:
    with pytest.raises(Unsupported, match="torque mode"):
        harness.robot.torque_stream(["joint2"])
    assert harness.robot.axes.owner(1) == ""
    with harness.robot.stream() as stream:
        assert stream.open


def test_a_start_that_takes_longer_than_a_period_is_repeated(harness: Harness) -> None:
    motion, axes = harness.robot.groups.only.motion, harness.robot.axes
    made: list[TorqueMotion] = []

    def make(start_ns: int) -> TorqueMotion:
        if not made:
            harness.run(5 * PERIOD_S)
        limits, chosen = harness.robot.follower.limits.of([1]), np.array([1])
        stopped, torques = np.array([0.01]), TorqueAxes()
        made.append(
            TorqueMotion(
                torques,
                robot_axes(torques, axes.speed, axes.stops),
                chosen,
                limits,
                start_ns,
                TIMEOUT_S,
                stopped,
                MotionLimits(),
            )
        )
        return made[-1]

    source = motion.start_alone([1], CommandMode.POSITION, make, "policy")
    assert source is made[1]
    assert harness.slot.running is source
    motion.release(source)
    assert source.completion.outcome is Outcome.CANCELED


def test_joints_that_move_are_not_taken(harness: Harness) -> None:
    motion: JointMotion = harness.robot.groups.only.motion
    with harness.robot.stream() as stream:
        with pytest.raises(NotReady, match="joint2: in use by stream"):
            harness.robot.torque_stream(["joint2"])
        assert stream.open
    assert not motion.moving
