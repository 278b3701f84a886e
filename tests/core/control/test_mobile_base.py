"""Mobile base on the simulation, on a clock that the tests advance."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.core.control.base_harness import COMMAND_S, BaseHarness, running

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.control.groups.descriptor_limits import twist_limits
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.device.axes import Jog
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, Operation
from robotd.errors import InvalidArgument, LateSetpoint, NotReady
from robotd.motion.planar import ORIGIN, ZERO_TWIST, PlanarTwist, Pose, along_arc
from robotd.motion.profile import Profile

TICK_S = 0.001


@pytest.fixture
def descriptor() -> RobotDescriptor:
    return load_robot_descriptor("baymax")


@pytest.fixture
def harness(descriptor: RobotDescriptor) -> Iterator[BaseHarness]:
    yield from running(descriptor)


class Truth:
    """Reference pose: Euler integration of the simulated wheels, tick by tick."""

    def __init__(self, harness: BaseHarness) -> None:
        self.harness = harness
        self.x = self.y = self.heading = self.distance = 0.0
        self.wheels = (harness.wheel(0), harness.wheel(1))

    def tick(self) -> None:
        before, self.wheels = self.wheels, (self.harness.wheel(0), self.harness.wheel(1))
        left, right = (0.09 * (b - a) for a, b in zip(before, self.wheels, strict=True))
        middle = self.heading + (right - left) / 0.55 / 2
        self.x += (left + right) / 2 * math.cos(middle)
        self.y += (left + right) / 2 * math.sin(middle)
        self.heading += (right - left) / 0.55
        self.distance += abs(left + right) / 2


def test_a_square_of_ten_metres_closes_and_odometry_is_the_truth(harness: BaseHarness) -> None:
    truth = Truth(harness)
    run_ticks = round(harness.period_s / TICK_S)

    def run(seconds: float) -> None:
        for _ in range(round(seconds / harness.period_s)):
            for _ in range(run_ticks):
                harness.clock.advance(TICK_S)
                with harness.simulation.world.lock:
                    harness.simulation.world.advance()
                truth.tick()
            harness.robot.control_loop.step(harness.clock.now_ns())

    harness.run = run  # type: ignore[method-assign]
    for _ in range(4):
        harness.drive(1.0, 0.0, 2.5)
        harness.drive(0.0, 0.0, 1.5)
        harness.drive(0.0, math.pi / 2, 1.0)
        harness.drive(0.0, 0.0, 1.5)
    pose = harness.base.pose
    assert truth.distance == pytest.approx(10.0, abs=0.01)
    assert math.hypot(pose.x - truth.x, pose.y - truth.y) < 1e-4
    assert math.remainder(pose.heading - truth.heading, 2 * math.pi) == pytest.approx(0, abs=1e-4)
    assert math.hypot(truth.x, truth.y) < 1e-3
    assert math.remainder(truth.heading, 2 * math.pi) == pytest.approx(0, abs=math.radians(0.1))


def test_without_commands_it_stops_on_its_arc_in_time(harness: BaseHarness) -> None:
    with capture_logs() as logs:
        harness.drive(0.8, 0.4, 2.0)
        limits = twist_limits(harness.base.settings)
        braking_s = 0.8 / limits.linear.deceleration + limits.smoothing()
        start_s = harness.clock.now_ns() / 1e9 - COMMAND_S
        previous = harness.twist.linear
        while harness.base.moving:
            harness.step()
            assert harness.twist.linear <= previous + 1e-6
            assert harness.twist.angular == pytest.approx(harness.twist.linear / 2, abs=1e-6)
            previous = harness.twist.linear
    took_s = harness.clock.now_ns() / 1e9 - start_s
    assert 0.5 < took_s <= 0.5 + braking_s + 2 * harness.period_s
    harness.settle()
    harness.step()
    assert list(harness.robot.image.operation) == [Operation.IDLE] * 2
    assert [log["event"] for log in logs] == ["no command in time: the base slows to rest"]


def test_the_wheels_ramp_in_the_time_of_the_parameters_not_at_once(harness: BaseHarness) -> None:
    settings = harness.base.settings
    assert settings.acceleration_m_s2 == 2.5
    harness.drive(1.0, 0.0, 0.2)
    assert 0.0 < harness.twist.linear < 0.5


def test_the_limited_command_is_what_the_wheels_are_sent(harness: BaseHarness) -> None:
    assert harness.base.limited == ZERO_TWIST
    harness.drive(1.0, 0.5, 0.2)
    left, right = harness.robot.image.setpoint[1]
    assert 0.0 < harness.base.limited.linear < 0.5
    assert harness.base.wheels.twist(left, right) == pytest.approx(harness.base.limited)
    harness.drive(2.0, 0.0, 2.0)
    assert harness.base.limited == pytest.approx(PlanarTwist(1.0, 0.0))
    harness.run(2.0)
    harness.settle()
    assert harness.base.limited == ZERO_TWIST


def test_multipliers_scale_wheel_speeds_and_odometry(descriptor: RobotDescriptor) -> None:
    assert descriptor.drive is not None
    factors = {"left_wheel_radius_multiplier": 0.5, "right_wheel_radius_multiplier": 0.8,
               "wheel_separation_multiplier": 2.0, "wheel_velocity_rad_s": 20.0}  # fmt: skip
    drive = descriptor.drive.model_copy(update=factors)
    for harness in running(descriptor.model_copy(update={"drive": drive})):
        harness.drive(0.3, 0.2, 3.0)
        left, right = harness.robot.image.velocity
        assert left == pytest.approx((0.3 - 0.2 * 0.55) / (0.5 * 0.09), rel=1e-3)
        assert right == pytest.approx((0.3 + 0.2 * 0.55) / (0.8 * 0.09), rel=1e-3)
        assert harness.twist == pytest.approx(PlanarTwist(0.3, 0.2), rel=1e-3)
        harness.drive(1.0, 0.0, 3.0)  # 0.9 m/s: the smaller wheel at its limit
        assert harness.robot.image.velocity[0] == pytest.approx(20.0, rel=1e-3)
        assert harness.twist == pytest.approx(PlanarTwist(0.9, 0.0), abs=1e-3)


def test_zero_commands_claim_and_log_nothing(harness: BaseHarness) -> None:
    with capture_logs() as logs:
        for _ in range(40):
            harness.base.command(0.0, 0.0)
            harness.settle()
            harness.run(COMMAND_S)
    assert not harness.base.moving
    assert logs == []
    harness.robot.axes.jog([Jog(0, Profile(1.0, 5.0, 5.0))])


def test_moving_wheels_are_claimed(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 0.5)
    with pytest.raises(NotReady, match="left wheel: in use by mobile base"):
        harness.robot.axes.jog([Jog(0, Profile(1.0, 5.0, 5.0))])


def test_a_free_wheel_is_limited_to_what_the_base_may_do(harness: BaseHarness) -> None:
    with pytest.raises(InvalidArgument, match=r"right wheel: velocity 12\.1 rad/s exceeds 12"):
        harness.robot.axes.jog([Jog(1, Profile(12.1, 5.0, 5.0))])


@pytest.mark.parametrize("twist", [(math.nan, 0.0), (0.0, math.inf), (-math.inf, math.nan)])
def test_a_twist_that_is_not_finite_is_rejected(
    harness: BaseHarness, twist: tuple[float, float]
) -> None:
    with pytest.raises(InvalidArgument, match="is not finite"):
        harness.base.command(*twist)
    harness.run(0.1)
    assert harness.base.pose == ORIGIN


@pytest.mark.parametrize("timeout_s", [0.0, -0.1, math.inf, math.nan])
def test_a_command_that_would_never_or_at_once_end_is_rejected(
    harness: BaseHarness, timeout_s: float
) -> None:
    with pytest.raises(InvalidArgument, match=f"timeout_s is {timeout_s}, must be a positive"):
        harness.base.command(0.5, 0.0, timeout_s=timeout_s)
    harness.run(0.1)
    assert harness.base.pose == ORIGIN


def test_a_servo_that_goes_off_stops_both_wheels_and_is_logged_once(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    with capture_logs() as logs:
        harness.robot.axes.servo(0, False)
        harness.step()
        harness.settle()
        for _ in range(20):
            with pytest.raises(NotReady, match="left wheel: servo is off"):
                harness.base.command(0.5, 0.0)
            harness.settle()
            harness.run(COMMAND_S)
        assert np.abs(harness.robot.image.velocity).max() < 1e-6
        harness.robot.axes.servo(0, True)
        harness.step()
        harness.base.command(0.0, 0.0)
        harness.drive(0.5, 0.0, 1.0)
    told = [(log["event"], log.get("reason")) for log in logs]
    assert told == [
        ("the base cannot move", "left wheel: servo is off"),
        ("the base can move again", None),
    ]
    assert harness.twist.linear == pytest.approx(0.5, abs=1e-3)


def test_an_alarm_stops_the_other_wheel_by_its_own_ramp(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    with harness.simulation.world.lock:
        harness.simulation.power.trip(1, 0x7305)
    with capture_logs() as logs:
        harness.step()
        harness.settle()
        harness.run(0.5)
    assert [log["reason"] for log in logs] == ["right wheel: amplifier alarm 29445 (encoder fault)"]
    assert abs(harness.robot.image.velocity[0]) < 1e-6


def test_wheels_stopped_by_another_command_are_claimed_again(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    harness.robot.axes.stop([1])
    with capture_logs() as logs:
        harness.step()
        harness.settle()
        harness.run(0.5)
        harness.drive(0.5, 0.0, 1.0)
    assert logs[0]["reason"] == "right wheel was stopped by something else"
    assert harness.twist.linear == pytest.approx(0.5, abs=1e-3)


def test_a_lost_device_ends_motion_and_the_odometry_continues(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    pose = harness.base.pose
    with harness.simulation.world.lock:
        harness.simulation.silence()
    harness.step()
    harness.settle()
    harness.run(1.0)
    assert harness.base.pose == pose
    harness.up()
    harness.run(0.1)
    assert harness.base.pose.x == pytest.approx(pose.x, abs=1e-6)
    harness.drive(0.5, 0.0, 0.5)
    assert harness.base.pose.x > pose.x + 0.01


def test_after_stop_commands_are_rejected_until_the_engine_restarts(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    clock = MonotonicClock()
    harness.base._clock = clock  # the stop waits while this thread makes time pass
    harness.base.stop(0.0)
    harness.base._clock = harness.clock
    with pytest.raises(NotReady, match="being stopped"):
        harness.base.command(0.5, 0.0)
    harness.run(1.0)
    harness.settle()
    assert harness.twist == pytest.approx(ZERO_TWIST, abs=1e-6)
    harness.robot.connection.stop_communication()
    harness.step()
    harness.up()
    harness.drive(0.5, 0.0, 0.5)
    assert harness.twist.linear > 0.1


def test_a_device_may_report_less_often_than_the_control_loop_runs(harness: BaseHarness) -> None:
    driver = harness.robot.control_loop._driver
    read, periods = driver.read, itertools.count()

    def read_slowly(image: ProcessImage) -> None:
        if next(periods) % 10 == 0:
            read(image)

    driver.read = read_slowly  # type: ignore[method-assign]
    with capture_logs() as logs:
        harness.drive(0.5, 0.0, 2.0)
    assert logs == []
    assert harness.base.limited == PlanarTwist(0.5, 0.0)


def test_a_request_to_end_leaves_the_base_its_own_ramp(harness: BaseHarness) -> None:
    harness.drive(1.0, 0.0, 2.0)
    harness.robot.connection.abort_start()
    with pytest.raises(NotReady, match="being shut down"):
        harness.base.command(1.0, 0.0)
    wheels = []
    while harness.base.moving:
        harness.step()
        wheels.append(harness.robot.image.setpoint[1, 0])
    harness.settle()
    settings = harness.base.settings
    step = settings.deceleration_m_s2 * harness.period_s / settings.wheel_radius_m
    assert np.abs(np.diff(wheels)).max() <= step * (1.0 + 1e-9)
    assert wheels[-1] == pytest.approx(0.0, abs=1e-9)


def test_the_pose_starts_at_zero_for_any_encoder_position(descriptor: RobotDescriptor) -> None:
    options = {"sim": {"initial_position_rad": [123.4, -56.7]}}
    for harness in running(descriptor.model_copy(update={"backends": options})):
        harness.run(0.1)
        assert harness.robot.image.position == pytest.approx([123.4, -56.7], abs=1e-6)
        assert harness.base.pose == ORIGIN


def test_homing_a_wheel_is_no_motion(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    harness.run(2.0)
    harness.settle()
    harness.step()
    pose = harness.base.pose
    with capture_logs() as logs:
        harness.robot.axes.home(0)
        harness.run(0.1)
    assert harness.base.pose == pose
    assert [log["event"] for log in logs] == [
        "a wheel's position has jumped; odometry goes on from there"
    ]


def test_values_that_stood_and_catch_up_are_motion(harness: BaseHarness) -> None:
    """A busy computer reads the positions of 40 ms ago as new ones, and the present ones after."""
    harness.drive(1.0, 0.0, 1.0)
    image, base = harness.robot.image.copy(), harness.base
    pose, steps = base.pose, 4
    with capture_logs() as logs:
        for step in range(1, steps + 1):
            image.fresh_ns += round(harness.period_s * NANOSECONDS)
            if step == steps:
                image.position[:] += steps * harness.period_s * 1.0 / 0.09
            base.track(image)
    assert logs == []
    assert base.pose.x - pose.x == pytest.approx(steps * harness.period_s * 1.0)


def test_reset_makes_the_current_pose_the_origin(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.5, 1.0)
    assert harness.base.pose.heading > 0.1
    harness.base.reset_odometry()
    assert harness.base.pose == ORIGIN
    before = harness.twist
    harness.step()
    step = PlanarTwist(before.linear * harness.period_s, before.angular * harness.period_s)
    assert harness.base.pose == pytest.approx(along_arc(Pose(0.0, 0.0, 0.0), step), abs=1e-3)


def test_wheels_are_put_into_velocity_mode(descriptor: RobotDescriptor) -> None:
    for harness in running(descriptor.model_copy(update={"parameters_file": None})):
        assert list(harness.robot.image.mode) == [CommandMode.VELOCITY] * 2
        harness.drive(0.5, 0.0, 0.5)
        assert harness.twist.linear > 0.1


def test_a_setpoint_that_was_not_sent_leaves_no_jump(harness: BaseHarness) -> None:
    """The next setpoint is one step from the last one that the device has."""
    sent: list[float] = []
    mixer = harness.robot.control_loop._mixer
    stream, periods = mixer._driver.stream, iter(range(10**6))

    def late(position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        if next(periods) % 3:
            raise LateSetpoint
        sent.append(float(velocity[0]))
        stream(position, velocity, due_ns)

    mixer._driver.stream = late  # type: ignore[method-assign]
    harness.drive(0.8, 0.0, 3.0)
    settings = harness.base.settings
    step = settings.acceleration_m_s2 * harness.period_s / settings.wheel_radius_m
    assert max(sent) == pytest.approx(0.8 / settings.wheel_radius_m)
    assert np.diff(sent).max() <= step * (1.0 + 1e-9)
    assert mixer.stats.late_setpoints > 50


def test_odometry_is_set_to_a_pose_and_goes_on_from_there(harness: BaseHarness) -> None:
    harness.drive(0.5, 0.0, 1.0)
    harness.run(2.0)
    harness.base.reset_odometry(Pose(3.0, -1.0, math.pi / 2))
    assert harness.base.pose == Pose(3.0, -1.0, math.pi / 2)
    harness.drive(0.5, 0.0, 1.0)
    harness.run(2.0)
    x, y, heading = harness.base.pose
    assert (x, heading) == pytest.approx((3.0, math.pi / 2), abs=1e-3)
    assert y > -0.9
    with pytest.raises(InvalidArgument, match="is not finite"):
        harness.base.reset_odometry(Pose(math.nan, 0.0, 0.0))


def test_a_stop_brakes_on_the_arc_and_a_command_has_to_be_neutral_first(
    harness: BaseHarness,
) -> None:
    harness.drive(0.8, 0.4, 2.0)
    harness.robot.axes.stop_latch.engage("by the operator")
    previous = harness.twist.linear
    while harness.base.moving:
        harness.step()
        assert previous - 2.0 * harness.period_s < harness.twist.linear <= previous + 1e-6
        assert harness.twist.angular == pytest.approx(harness.twist.linear / 2, abs=1e-6)
        previous = harness.twist.linear
    assert previous == pytest.approx(0.0, abs=1e-3)
    harness.settle()
    with pytest.raises(NotReady, match="motion is stopped: by the operator; robotd reset"):
        harness.base.command(0.8, 0.4)
    harness.robot.axes.stop_latch.release(1)
    for _ in range(20):  # the client goes on as before
        harness.run(COMMAND_S)
        with pytest.raises(NotReady, match=r"send nothing for 0\.5 s\), or send a zero twist"):
            harness.base.command(0.8, 0.4)
    assert not harness.base.moving
    harness.base.command(0.0, 0.0)
    harness.drive(0.8, 0.4, 0.5)
    assert harness.twist.linear > 0.1


def test_after_a_stop_a_pause_as_long_as_the_time_out_is_neutral_too(harness: BaseHarness) -> None:
    harness.drive(0.8, 0.4, 1.0)
    harness.robot.axes.stop_latch.engage("by the operator")
    harness.run(1.0)
    harness.settle()
    harness.robot.axes.stop_latch.release(1)
    harness.drive(0.8, 0.4, 0.5)
    assert harness.twist.linear > 0.1


def test_the_speed_of_the_operator_keeps_the_arc(harness: BaseHarness) -> None:
    harness.drive(0.8, 0.4, 2.0)
    harness.robot.set_speed(0.5)
    previous = harness.twist.linear
    for _ in range(40):
        harness.base.command(0.8, 0.4)
        harness.run(COMMAND_S)
        assert abs(harness.twist.linear - previous) <= 1.0 * COMMAND_S + 1e-6
        assert harness.twist.angular == pytest.approx(harness.twist.linear / 2, abs=1e-3)
        previous = harness.twist.linear
    assert harness.twist.linear == pytest.approx(0.4, abs=0.01)
    harness.robot.pause()
    for _ in range(40):
        harness.base.command(0.8, 0.4)
        harness.run(COMMAND_S)
    assert harness.twist.linear == pytest.approx(0.0, abs=1e-3)


def test_a_command_of_a_time_to_come_does_not_put_its_time_out_off(harness: BaseHarness) -> None:
    in_an_hour_ns = harness.clock.now_ns() + 3600 * NANOSECONDS
    harness.base.command(0.3, 0.0, sent_ns=in_an_hour_ns)
    harness.wait(lambda: harness.base.moving)
    harness.run(3.0)
    assert not harness.base.moving
    assert harness.twist == pytest.approx(ZERO_TWIST, abs=1e-6)


def test_a_command_at_the_end_of_a_motion_is_not_lost(harness: BaseHarness) -> None:
    harness.drive(0.2, 0.0, COMMAND_S)
    (motion,) = harness.base._slot.active
    end = motion.completion.on_end

    def command_at_the_end() -> None:
        end()
        harness.base.command(0.2, 0.0, timeout_s=5.0)

    motion.completion.on_end = command_at_the_end
    harness.run(2.0)
    assert motion.completion.done
    harness.settle()
    harness.run(1.0)
    assert harness.twist.linear > 0.15
