"""Tricycle base on the simulation, on a clock that the tests advance."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.core.control.base_harness import BaseHarness, running

from robotd.arrays import FloatArray
from robotd.descriptor import load_robot_descriptor
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import DeviceTimeout, InvalidArgument
from robotd.motion.planar import PlanarTwist

WHEELBASE_M, RADIUS_M = 0.8, 0.1
TRACTION, STEERING = 0, 1
TICK_S = 0.001


@pytest.fixture
def harness() -> Iterator[BaseHarness]:
    yield from running(load_robot_descriptor("tricycle_base"))


def test_the_wheel_rolls_and_the_steering_is_in_position_mode(harness: BaseHarness) -> None:
    image = harness.robot.image
    assert image.mode[[TRACTION, STEERING]].tolist() == [CommandMode.VELOCITY, CommandMode.POSITION]
    harness.drive(0.3, 0.2, 3.0)
    angle = math.atan2(WHEELBASE_M * 0.2, 0.3)
    assert image.position[STEERING] == pytest.approx(angle, abs=1e-3)
    rim = math.hypot(0.3, WHEELBASE_M * 0.2)
    assert RADIUS_M * image.velocity[TRACTION] == pytest.approx(rim, abs=2e-3)
    assert harness.twist == pytest.approx(PlanarTwist(0.3, 0.2), abs=2e-3)


def test_the_base_comes_to_rest_with_its_angle_and_odometry_holds(harness: BaseHarness) -> None:
    harness.drive(0.3, 0.3, 3.0)
    harness.drive(0.0, 0.0, 0.1)
    harness.run(3.0)
    assert not harness.base.moving
    turn, angle = (float(harness.robot.image.position[axis]) for axis in (TRACTION, STEERING))
    assert angle == pytest.approx(math.atan2(WHEELBASE_M, 1.0), abs=1e-3)
    pose = harness.base.pose
    harness.drive(-0.3, -0.3, 3.0)  # back on the same arc
    harness.drive(0.0, 0.0, 0.1)
    harness.run(3.0)
    back = float(harness.robot.image.position[TRACTION])
    rest = (back / turn) * pose.heading
    assert pose.heading > 0.5
    assert harness.base.pose.heading == pytest.approx(rest, abs=0.05)


def test_the_base_stays_where_the_angle_of_its_steering_is_not_known(harness: BaseHarness) -> None:
    driver = harness.robot.control_loop._driver
    read, stream, sent = driver.read, driver.stream, []

    def read_partly(image: ProcessImage) -> None:
        read(image)
        image.position_command[STEERING] = math.nan

    def record(position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        sent.append(position[STEERING])
        stream(position, velocity, due_ns)

    driver.read, driver.stream = read_partly, record  # type: ignore[method-assign]
    harness.step()
    with capture_logs() as logs:
        harness.drive(0.3, 0.2, 0.5)
    assert not sent
    assert logs[0]["reason"].endswith(": the present position is not known")


def test_repeated_stalls_slow_the_base_and_end_nothing(harness: BaseHarness) -> None:
    harness.drive(0.3, 0.0, 1.0)
    speeds = list[float]()
    for _ in range(100):  # two seconds
        harness.base.command(0.3, 0.3)
        harness.clock.advance(0.016)
        harness.run(2 * harness.period_s)
        speeds.append(harness.twist.linear)
        assert harness.base.moving
    assert min(speeds) < 0.2, "it is slower"
    harness.drive(0.3, 0.3, 6.0)
    assert harness.twist == pytest.approx(PlanarTwist(0.3, 0.3), abs=2e-3)


@pytest.mark.parametrize("stall_s", [0.01, 0.04])
def test_the_steering_continues_where_a_stall_has_led_it(
    harness: BaseHarness, stall_s: float
) -> None:
    world, servo = harness.simulation.world, harness.simulation.servo
    limits = harness.robot.axes.limits[STEERING]
    angles: list[float] = []

    def run(seconds: float, periods: int) -> None:
        for _ in range(periods):
            for _ in range(round(seconds / TICK_S)):
                harness.clock.advance(TICK_S)
                with world.lock:
                    world.advance()
                angles.append(float(servo.command[STEERING]))
            harness.robot.control_loop.step(harness.clock.now_ns())

    harness.drive(0.3, 0.0, 1.0)
    harness.drive(0.3, 0.3, 0.2)
    run(stall_s, 1)
    harness.base.command(0.3, 0.3)
    run(harness.period_s, 100)
    speed = np.diff(angles) / TICK_S
    assert speed.max() == pytest.approx(limits.velocity, rel=0.1), "it turned in the stall"
    assert speed.min() > -0.1
    after = speed[round(stall_s / TICK_S) :]  # in a longer stall the drive holds by itself
    assert np.abs(np.diff(after)).max() < 3.0 * limits.acceleration * harness.period_s
    assert harness.base.moving
    harness.drive(0.3, 0.3, 2.0)
    angle = float(harness.robot.image.position[STEERING])
    assert angle == pytest.approx(math.atan2(WHEELBASE_M * 0.3, 0.3), abs=1e-3)


def test_after_a_long_stall_the_steering_goes_on_from_where_it_holds(harness: BaseHarness) -> None:
    harness.drive(0.3, 0.0, 1.0)
    harness.drive(0.3, 0.3, 0.2)
    harness.clock.advance(0.1)
    harness.base.command(0.3, 0.3)
    with capture_logs() as logs:
        harness.robot.control_loop.step(harness.clock.now_ns())
        harness.settle()
        held = float(harness.simulation.servo.command[STEERING])
        harness.step()
        step = float(harness.simulation.servo.command[STEERING]) - held
        harness.drive(0.3, 0.3, 2.0)
    assert [log for log in logs if log["log_level"] != "info"] == []
    limits = harness.robot.axes.limits[STEERING]
    assert 0.0 <= step < 3.0 * limits.acceleration * harness.period_s**2
    angle = float(harness.robot.image.position[STEERING])
    assert angle == pytest.approx(math.atan2(WHEELBASE_M * 0.3, 0.3), abs=1e-3)


def test_a_fixed_axle_drives_the_same_arc() -> None:
    robot = load_robot_descriptor("tricycle_base")
    drive = robot.drive.model_copy(update={"traction": "fixed"}) if robot.drive else None
    for harness in running(robot.model_copy(update={"drive": drive})):
        harness.drive(0.3, 0.2, 3.0)
        assert RADIUS_M * harness.robot.image.velocity[TRACTION] == pytest.approx(0.3, abs=2e-3)
        assert harness.twist == pytest.approx(PlanarTwist(0.3, 0.2), abs=2e-3)


def test_reverse_steers_to_the_other_side(harness: BaseHarness) -> None:
    harness.drive(-0.3, 0.2, 3.0)
    assert harness.robot.image.position[STEERING] < -0.4
    assert harness.twist == pytest.approx(PlanarTwist(-0.3, 0.2), abs=2e-3)


def test_a_turn_on_the_spot_is_rejected(harness: BaseHarness) -> None:
    with pytest.raises(InvalidArgument, match=r"0\.5 rad/s at 0 m/s: the base cannot turn"):
        harness.base.command(0.0, 0.5)


def test_a_servo_that_goes_off_ends_the_motion(harness: BaseHarness) -> None:
    harness.drive(0.3, 0.2, 1.0)
    harness.robot.axes.servo(STEERING, False)
    harness.step()
    harness.settle()
    harness.run(2.0)
    assert abs(harness.robot.image.velocity[TRACTION]) < 1e-6


def test_a_stop_ends_at_standstill_where_a_fault_ends_the_motion_in_it(
    harness: BaseHarness,
) -> None:
    robot = harness.robot
    harness.drive(0.3, 0.3, 0.3)
    assert robot.image.velocity[STEERING] > 0.5
    robot.axes.stop_latch.engage("by the operator")
    harness.step()
    with harness.simulation.world.lock:
        harness.simulation.power.trip(TRACTION, 17)
    harness.wait(lambda: not harness.base.moving)
    with pytest.raises(DeviceTimeout, match="axes still move"):
        robot._motion_stop.reset(0.0)
    harness.wait(lambda: robot._motion_stop.at_rest)
    assert abs(harness.simulation.servo.command_velocity[STEERING]) < 1e-9
    assert "allowed again" in robot.reset()
