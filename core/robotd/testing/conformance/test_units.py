"""Units and signs: a commanded radian is a measured radian, a second is a second."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.device.axes import Jog
from robotd.device.bench import Bench
from robotd.device.capabilities import Capability
from robotd.device.drivers import Profile
from robotd.device.image import ProcessImage
from robotd.device.state import CommandMode
from robotd.testing.conformance.attempts import judge
from robotd.testing.conformance.recording import Recording
from robotd.testing.conformance.rig import SETTLED_RAD, MakeRig, Rig

LAG_S = 0.03  # granted between a commanded and a measured value


def test_a_commanded_radian_is_a_measured_radian(rig: Rig) -> None:
    start = rig.image.position.copy()
    for sign in (1.0, -1.0):
        distance = sign * rig.travel()
        targets = rig.image.position_command + distance
        rig.move(rig.all, targets)
        rig.rest()
        assert rig.image.position == pytest.approx(targets, abs=SETTLED_RAD)
    assert rig.image.position == pytest.approx(start, abs=SETTLED_RAD)


def test_each_axis_moves_alone(rig: Rig) -> None:
    for axis, distance in zip(rig.all, rig.travel(0.2), strict=True):
        before = rig.image.position.copy()
        rig.move([axis], before + distance)
        rig.rest([axis])
        before[axis] += distance
        assert rig.image.position == pytest.approx(before, abs=SETTLED_RAD)


def test_a_streamed_radian_is_a_measured_radian(rig: Rig) -> None:
    if rig.robot.axes.trajectories_on_device:
        pytest.skip("positions are not streamed: trajectories run on the device")
    start = rig.image.position_command.copy()
    end = start + rig.travel(0.3)
    stream_ramp(rig, start, end, seconds=1.0)
    assert rig.image.position == pytest.approx(end, abs=SETTLED_RAD)


def test_the_measured_position_is_that_of_the_shaft(rig: Rig, bench: Bench) -> None:
    start = np.array([bench.position(axis) for axis in rig.all])
    assert rig.image.position == pytest.approx(start, abs=SETTLED_RAD)
    distance = rig.travel()
    rig.move(rig.all, rig.image.position_command + distance)
    rig.rest()
    end = np.array([bench.position(axis) for axis in rig.all])
    assert end - start == pytest.approx(distance, abs=2 * SETTLED_RAD)


def test_the_velocity_is_the_slope_of_the_position(rig: Rig) -> None:
    def motion() -> Recording:
        with rig.recording() as recording:
            rig.move(rig.all, rig.image.position_command + rig.travel())
            rig.rest()
        return recording

    def problems(recording: Recording) -> list[str]:
        times_s, slope = recording.slope(recording.position, 0.02)
        found = []
        for axis in rig.all:
            measured = np.interp(times_s, recording.time_s, recording.velocity[:, axis])
            profile, error = rig.profile(axis), np.abs(measured - slope[:, axis]).max()
            if error > 0.05 * profile.velocity + LAG_S * profile.acceleration:
                found.append(f"axis {axis}: measured {error:.3g} rad/s beside the slope")
        return found

    judge(rig, motion, problems)


def test_the_commands_in_the_image_are_those_that_were_given(rig: Rig) -> None:
    with rig.recording() as recording:
        targets = rig.image.position_command + rig.travel()
        rig.move(rig.all, targets)
        rig.rest()
    assert recording.position_command[-1] == pytest.approx(targets, abs=SETTLED_RAD)
    for axis in rig.all:
        profile = rig.profile(axis)
        error = np.abs(recording.position_command[:, axis] - recording.position[:, axis])
        assert error.max() <= SETTLED_RAD + LAG_S * profile.velocity
        top = np.abs(recording.velocity_command[:, axis]).max()
        assert top <= 1.02 * profile.velocity


def test_torque_is_finite_or_not_known(rig: Rig) -> None:
    rig.move(rig.all, rig.image.position_command + rig.travel(0.3))
    rig.periods(10)
    assert not np.isinf(rig.image.torque).any()
    rig.rest()


@pytest.mark.needs(Capability.VELOCITY_MODE)
def test_a_positive_velocity_raises_the_position(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    for axis in rig.all:
        rig.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    rig.until(lambda: bool((rig.image.mode == CommandMode.VELOCITY).all()), "all in velocity mode")
    speeds = np.sign(rig.travel()) * [rig.profile(axis, 0.3).velocity for axis in rig.all]
    start = rig.image.position.copy()
    jog(rig, speeds)
    rig.let(0.5)
    assert rig.image.velocity == pytest.approx(speeds, rel=0.05, abs=0.01)
    jog(rig, 0.0 * speeds)
    rig.rest()
    assert (np.sign(rig.image.position - start) == np.sign(speeds)).all()


@pytest.mark.needs(Capability.VELOCITY_MODE)
def test_a_streamed_velocity_is_a_measured_velocity(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    for axis in rig.all:
        rig.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    speeds = np.sign(rig.travel()) * [rig.profile(axis, 0.3).velocity for axis in rig.all]
    unknown, began_ns = np.full(rig.count, np.nan), rig.clock.now_ns()

    def setpoint(image: ProcessImage) -> None:
        share = min((rig.clock.now_ns() - began_ns) * 1e-9 / 0.3, 1.0)
        rig.parts.driver.stream(unknown, share * speeds)

    claim = rig.robot.axes.claimed("conformance", rig.all, CommandMode.VELOCITY)
    with claim, rig.each_period(setpoint):
        rig.let(0.5)
        assert rig.image.velocity == pytest.approx(speeds, rel=0.05, abs=0.01)
    rig.rest()


@pytest.mark.needs(Capability.SCALING)
def test_polarity_turns_the_sign(make_rig: MakeRig) -> None:
    rig = rescalable(make_rig)
    for axis in rig.all:
        rig.robot.axes.set_polarity(axis, 1)
    rig.periods(5)
    before = rig.image.position.copy()
    for axis in rig.all:
        rig.robot.axes.set_polarity(axis, -1)
    rig.periods(5)
    assert rig.image.position == pytest.approx(-before, abs=SETTLED_RAD)


@pytest.mark.needs(Capability.SCALING)
def test_the_gear_ratio_counts_units(make_rig: MakeRig) -> None:
    rig = rescalable(make_rig)
    moved = []
    for numerator in (2.0**18, 2.0**19):
        for axis in rig.all:
            rig.robot.axes.set_gear_ratio(axis, numerator, 2.0 * np.pi)
        rig.periods(5)
        moved.append(rig.image.position.copy())
    assert moved[0] == pytest.approx(2.0 * moved[1], abs=SETTLED_RAD)


@pytest.mark.needs(Capability.HOMING)
def test_homing_makes_the_position_zero_and_moves_nothing(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    if not rig.may_rescale():
        pytest.skip(NO_WAY_BACK)
    rig.move(rig.all, rig.image.position_command + rig.travel())
    rig.rest()
    bench = rig.bench
    for axis in rig.all:
        rig.robot.axes.home(axis)
    rig.rest()
    assert rig.image.home_done.all()
    assert rig.image.position == pytest.approx(np.zeros(rig.count), abs=SETTLED_RAD)
    assert rig.image.position_command == pytest.approx(np.zeros(rig.count), abs=SETTLED_RAD)
    assert bench is None or not rig.image.velocity.any()


NO_WAY_BACK = "would change the drives' scale for good: the robot has no parameter file"


def rescalable(make_rig: MakeRig) -> Rig:
    """A rig of its own, away from zero, with the servos off."""
    rig = make_rig()
    rig.up()
    if not rig.may_rescale():
        pytest.skip(NO_WAY_BACK)
    rig.move(rig.all, rig.image.position_command + rig.travel())
    rig.rest()
    for axis in rig.all:
        rig.robot.axes.servo(axis, False)
    rig.until(lambda: not rig.image.servo_on.any(), "all servos are off")
    return rig


def jog(rig: Rig, speeds: np.ndarray) -> None:
    jogs = []
    for axis in rig.all:
        ramp = rig.profile(axis).acceleration
        jogs.append(Jog(axis, Profile(float(speeds[axis]), ramp, ramp)))
    rig.robot.axes.jog(jogs)


def stream_ramp(rig: Rig, start: np.ndarray, end: np.ndarray, seconds: float) -> None:
    """Stream a smooth way from ``start`` to ``end`` on every axis, as the cycle does it."""
    driver, clock, began_ns = rig.parts.driver, rig.clock, rig.clock.now_ns()

    def setpoint(image: object) -> None:
        share = min((clock.now_ns() - began_ns) * 1e-9 / seconds + rig.period_s / seconds, 1.0)
        way, slope = 3 * share**2 - 2 * share**3, 6 * (share - share**2) / seconds
        driver.stream(start + way * (end - start), slope * (end - start))

    with rig.robot.axes.claimed("conformance", rig.all), rig.each_period(setpoint):
        rig.let(seconds + 0.1)
    rig.rest()
