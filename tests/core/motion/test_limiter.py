"""Limits, arrival and continuity of streamed setpoints, for random limits, targets and rates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from robotd.arrays import FloatArray
from robotd.motion import JointLimits, MotionState
from robotd.motion.limiter import SetpointLimiter
from robotd.motion.target_spline import TargetSpline

PERIOD_S = 0.004
REST_PERIODS = 5_000  # 20 s
PHASES = (Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink)


def limits_of(
    velocity: float = 3.14, acceleration: float = 12.57, jerk: float | None = None, joints: int = 1
) -> JointLimits:
    every = np.ones(joints)
    return JointLimits(
        tuple(f"joint{index}" for index in range(joints)),
        -2.0 * every,
        2.0 * every,
        velocity * every,
        acceleration * every,
        jerk=np.zeros(0) if jerk is None else jerk * every,
    )


class Recorder:
    """Runs a limiter, and checks each setpoint against the one before and the limits."""

    def __init__(self, limits: JointLimits, period_s: float = PERIOD_S) -> None:
        self.limits, self.period_s = limits, period_s
        self.limiter = SetpointLimiter(limits, period_s)
        self.checked = True

    def step(self, spline: TargetSpline | None = None) -> None:
        before, limits = self.limiter.state.copy(), self.limits
        if spline is None:
            after = self.limiter.step()
        else:
            reference = spline.advance(self.period_s)
            after = self.limiter.track(reference, spline.newest, spline.rests)
        jerk = (after[2] - before[2]) / self.period_s
        travelled = after[0] - before[0]
        mean = (before[1] + after[1]) / 2.0
        assert np.isfinite(after).all()
        # Of constant jerk at most: the deviation from the trapezoid is j·dt³/12.
        room = limits.jerk * self.period_s**3 / 4.0 + 1e-9
        assert (np.abs(travelled - mean * self.period_s) <= room).all()
        assert (after[0] >= limits.lower - 1e-7).all()
        assert (after[0] <= limits.upper + 1e-7).all()
        assert (np.abs(after[1]) <= limits.velocity * 1.000001).all()
        assert (np.abs(after[2]) <= limits.acceleration * 1.000001).all()
        assert (np.abs(jerk) <= limits.jerk * 1.0001 + 1e-4 / self.period_s).all()

    def come_to_rest(self) -> None:
        for _ in range(REST_PERIODS):
            self.step()
            if self.limiter.at_rest:
                return
        pytest.fail(f"moves still: {self.limiter.state}")


velocities = st.floats(0.5, 10.0)
ramps_s = st.floats(0.05, 0.5)  # from rest to full speed, and to full acceleration
targets = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2).map(np.array)
commands = st.one_of(
    st.tuples(st.just("approach"), targets, st.integers(1, 200)),
    st.tuples(st.just("move"), targets, st.integers(1, 200)),
    st.tuples(st.just("stop"), targets, st.integers(1, 50)),
)


@settings(max_examples=20, phases=PHASES)
@given(velocities, ramps_s, ramps_s, st.lists(commands, min_size=1, max_size=12))
def test_targets_velocities_and_stops_at_any_time_keep_every_limit_and_come_to_rest(
    velocity: float,
    ramp_s: float,
    jerk_s: float,
    program: list[tuple[str, FloatArray, int]],
) -> None:
    acceleration = velocity / ramp_s
    run = Recorder(limits_of(velocity, acceleration, acceleration / jerk_s, joints=2))
    for kind, value, periods in program:
        match kind:
            case "approach":
                run.limiter.approach(value)
            case "move":
                run.limiter.move(value * velocity)
            case _:
                run.limiter.stop()
        for _ in range(periods):
            run.step()
    run.limiter.stop()
    run.come_to_rest()
    run.limiter.approach(np.array([1.0, -1.0]))
    run.come_to_rest()
    assert run.limiter.state[0] == pytest.approx([1.0, -1.0], abs=1e-9)
    assert run.limiter.failures == 0


@settings(max_examples=20, phases=PHASES)
@given(
    velocities,
    ramps_s,
    ramps_s,
    st.floats(10.0, 500.0),
    st.lists(st.tuples(targets, st.floats(0.0, 1.0), st.booleans()), min_size=3, max_size=40),
)
def test_smoothed_targets_with_jitter_and_drop_outs_keep_every_limit_and_come_to_rest(
    velocity: float,
    ramp_s: float,
    jerk_s: float,
    rate_hz: float,
    arrivals: list[tuple[FloatArray, float, bool]],
) -> None:
    acceleration = velocity / ramp_s
    run = Recorder(limits_of(velocity, acceleration, acceleration / jerk_s, joints=2))
    state = run.limiter.state
    spline = TargetSpline(state[0], state[1], arrivals[0][0], 0)
    time_s = 0.0
    for index, (target, jitter, lost) in enumerate(arrivals):
        while time_s < (index + jitter) / rate_hz:
            time_s += PERIOD_S
            run.step(spline)
        if not lost:
            spline.add(target, round(time_s * 1e9))
    end = np.clip(spline.newest, -2.0, 2.0)
    for _ in range(REST_PERIODS):
        run.step(spline)
        if run.limiter.at_rest and np.abs(run.limiter.state[0] - end).max() < 1e-9:
            break
    else:
        pytest.fail(f"not at {end}: {run.limiter.state}")
    assert run.limiter.failures == 0


@settings(max_examples=20, phases=PHASES)
@given(velocities, ramps_s, ramps_s, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.booleans())
def test_a_target_that_stands_still_is_not_overshot(
    velocity: float, ramp_s: float, jerk_s: float, start: float, target: float, smooth: bool
) -> None:
    acceleration = velocity / ramp_s
    run = Recorder(limits_of(velocity, acceleration, acceleration / jerk_s))
    limiter, end = run.limiter, np.array([target])
    limiter.reset(MotionState.at_rest(np.array([start])))
    spline = TargetSpline(limiter.state[0].copy(), limiter.state[1].copy(), end, 0)
    limiter.approach(end)
    low, high = min(start, target), max(start, target)
    for _ in range(REST_PERIODS):
        run.step(spline if smooth else None)
        assert low - 1e-8 <= limiter.state[0, 0] <= high + 1e-8
        if limiter.at_rest and abs(limiter.state[0, 0] - target) < 1e-9:
            break
    else:
        pytest.fail(f"not at {target}: {limiter.state}")


def test_a_joint_beyond_a_limit_comes_back_in() -> None:
    limiter = SetpointLimiter(limits_of(), PERIOD_S)
    limiter.reset(MotionState(np.array([2.1]), np.array([0.5]), np.array([0.0])))
    limiter.approach(np.array([3.0]))
    for _ in range(1000):
        limiter.step()
    assert limiter.state[0] == pytest.approx([2.0], abs=1e-9)
    assert limiter.at_rest


def test_a_velocity_beyond_the_limit_is_braked_first() -> None:
    limiter = SetpointLimiter(limits_of(velocity=1.0), PERIOD_S)
    limiter.reset(MotionState(np.array([-1.0]), np.array([1.5]), np.array([0.0])))
    limiter.move(np.array([5.0]))
    for _ in range(200):
        limiter.step()
    assert limiter.state[1] == pytest.approx([1.0])


def test_a_start_that_is_too_fast_to_stop_brakes_harder_than_the_limit() -> None:
    limiter = SetpointLimiter(limits_of(), PERIOD_S)
    limiter.reset(MotionState(np.array([1.9]), np.array([3.0]), np.array([0.0])))
    highest = 0.0
    for _ in range(500):
        limiter.step()
        highest = max(highest, limiter.state[0, 0])
    assert highest <= 2.0 + 1e-6
    assert limiter.at_rest


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_whose_range_excludes_zero_stops_within_its_limits(sign: float) -> None:
    one = np.ones(1)
    lower, upper = sorted((sign * 0.5, sign * 2.0))
    limits = JointLimits(("lift",), lower * one, upper * one, one, 2.0 * one, jerk=40.0 * one)
    run = Recorder(limits)
    run.limiter.reset(MotionState.at_rest(sign * one))
    run.limiter.move(0.5 * one)
    for _ in range(100):
        run.step()
    run.limiter.stop()
    run.come_to_rest()
    run.limiter.approach(sign * 2.0 * one)
    for _ in range(100):
        run.step()
    run.limiter.stop()
    run.come_to_rest()


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_a_30_hz_sine_is_followed_without_ripple_and_with_a_short_lag(jitter: float) -> None:
    amplitude, angular = 0.4, 2.0 * np.pi * 0.4
    limiter = SetpointLimiter(limits_of(), PERIOD_S)
    generator = np.random.default_rng(4)
    spline: TargetSpline | None = None
    recorded, due, sent = [], 0.0, 0
    for period in range(2500):
        time_s = period * PERIOD_S
        while due <= time_s:
            target = amplitude * np.sin(angular * np.array([sent / 30.0]))
            if spline is None:
                spline = TargetSpline(limiter.state[0], limiter.state[1], target, 0)
            else:
                spline.add(target, round(time_s * 1e9))
            sent += 1
            due = (sent + generator.uniform(0.0, jitter)) / 30.0
        assert spline is not None
        limiter.track(spline.advance(PERIOD_S), spline.newest, spline.rests)
        recorded.append((time_s + PERIOD_S, *limiter.state[:, 0]))
    times, position, velocity, _ = np.array(recorded)[625:].T
    waves = np.column_stack((np.sin(angular * times), np.cos(angular * times)))
    sine, cosine = np.linalg.lstsq(waves, position)[0]
    ripple = velocity - waves @ np.linalg.lstsq(waves, velocity)[0]
    assert -np.arctan2(cosine, sine) / angular <= 0.080
    assert np.sqrt(np.mean(ripple**2)) <= 0.05
    assert np.hypot(sine, cosine) == pytest.approx(amplitude, rel=0.01)


@pytest.mark.parametrize("room", [0.001, 0.1, 0.4])
def test_a_stop_may_be_held_within_twice_the_acceleration_limit(room: float) -> None:
    limits = limits_of()
    limiter = SetpointLimiter(limits, PERIOD_S)
    limiter.reset(MotionState(np.array([2.0 - room]), np.array([3.0]), np.array([0.0])), 2.0)
    limiter.approach(np.array([2.0]))
    positions, velocities = [], [3.0]
    for _ in range(1000):
        limiter.step()
        positions.append(limiter.state[0, 0])
        velocities.append(limiter.state[1, 0])
    strongest = 2.0 * limits.acceleration[0]
    assert np.abs(np.diff(velocities)).max() / PERIOD_S <= strongest * (1.0 + 1e-9)
    braking = 3.0**2 / (2.0 * strongest)
    assert max(positions) <= 2.0 + max(0.0, braking - room) + 3.0 * 2 * PERIOD_S
    assert positions[-1] == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("periods", [1, 2, 5])
@pytest.mark.parametrize("room", [0.06, 0.1, 0.3])
def test_a_target_behind_a_hard_stop_does_not_lead_beyond_the_position_limit(
    room: float, periods: int
) -> None:
    limiter = SetpointLimiter(limits_of(), 0.001)
    limiter.reset(MotionState(np.array([2.0 - room]), np.array([3.0]), np.array([0.0])))
    for _ in range(periods):
        limiter.step()
    limiter.approach(np.array([1.0]))  # turns while the acceleration is constant
    farthest = max(float(limiter.step()[0, 0]) for _ in range(800))
    assert farthest <= 2.0 + 1e-7
    assert limiter.state[0] == pytest.approx([1.0], abs=1e-6)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("periods", [1, 2, 5, 15])
@pytest.mark.parametrize("room", [0.03, 0.1, 0.3])
def test_a_command_during_a_stop_beyond_the_limits_keeps_the_velocity_limit(
    room: float, periods: int, smooth: bool
) -> None:
    limiter = SetpointLimiter(limits_of(), PERIOD_S)
    limiter.reset(MotionState(np.array([2.0 - room]), np.array([3.0]), np.array([0.0])))
    for _ in range(periods):
        limiter.step()
    target = np.array([1.0])
    spline = TargetSpline(limiter.state[0], limiter.state[1], target, 0)
    limiter.approach(target)
    for _ in range(1000):
        if smooth:
            limiter.track(spline.advance(PERIOD_S), spline.newest, spline.rests)
        else:
            limiter.step()
        assert abs(limiter.state[1, 0]) <= 3.14 * (1.0 + 1e-6)
    assert limiter.state[0] == pytest.approx(target, abs=1e-6)


@pytest.mark.parametrize("begin", [2.1, -2.1])
def test_a_velocity_does_not_lead_a_joint_beyond_its_limit_farther_out(begin: float) -> None:
    limiter = SetpointLimiter(limits_of(), PERIOD_S)
    outward = np.sign(begin)
    limiter.reset(MotionState(np.array([begin]), np.array([0.0]), np.array([0.0])))
    limiter.move(np.array([outward * 0.5]))
    farthest = 0.0
    for _ in range(1000):
        limiter.step()
        farthest = max(farthest, abs(limiter.state[0, 0]))
    assert farthest <= abs(begin) + 1e-9
    assert limiter.state[0] == pytest.approx([outward * 2.0], abs=1e-6)
    limiter.move(np.array([-outward * 0.5]))
    limiter.step()
    assert limiter.state[1, 0] * outward < 0.0
