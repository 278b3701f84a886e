from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal
from tests.plugins.sim.harness import PROFILE, TICK_S, Harness, harness

from robotd.api import Profile


@pytest.mark.parametrize(("bandwidth", "forward"), [(50.0, 0.0), (50.0, 0.9), (10.0, 0.5)])
def test_the_following_error_of_a_ramp_is_that_of_a_first_order_lag(
    bandwidth: float, forward: float
) -> None:
    made = harness(1, bandwidth_hz=bandwidth, feedforward=forward)
    made.axes.jog(0, Profile(3.0, 30.0, 30.0))
    image = made.look(2.0)
    error = image.position_command[0] - image.position[0]
    assert error == pytest.approx((1 - forward) * 3.0 / (2 * math.pi * bandwidth), abs=1e-5)
    assert image.velocity[0] == pytest.approx(3.0, abs=1e-6)


def test_the_response_to_a_move_is_the_exact_solution_of_the_lag() -> None:
    made = harness(1, bandwidth_hz=20.0, feedforward=0.3, encoder_counts_per_turn=2**30)
    made.axes.move(0, 0.5, PROFILE)
    record = made.record(1.0)
    tau = 1 / (2 * math.pi * 20.0)
    lag = signal.TransferFunction([0.3 * tau, 1], [tau, 1])
    times = np.concatenate([[0.0], record.time_s])
    command = np.concatenate([[0.0], record.command[:, 0]])
    _, expected, _ = signal.lsim(lag, command, times)  # joins its inputs by straight lines
    # lsim does not know of the derivative that feed-forward takes, except through its zero
    assert np.abs(record.position[:, 0] - expected[1:]).max() < 1e-4


def test_torque_is_that_of_inertia_and_friction() -> None:
    made = harness(2, inertia_kg_m2=0.8, viscous_friction_nm_s=1.5, coulomb_friction_nm=2.0)
    made.axes.jog(0, Profile(2.0, 4.0, 4.0))
    image = made.look(0.25)
    assert image.torque[0] == pytest.approx(0.8 * 4 + 1.5 * 1.0 + 2.0, abs=0.02)
    image = made.look(1.0)
    assert image.torque[0] == pytest.approx(1.5 * 2.0 + 2.0, abs=0.02)
    assert image.torque[1] == 0


def look_often(made: Harness, seconds: float) -> None:
    for _ in range(round(seconds / TICK_S)):
        made.look(TICK_S)


def look_rarely(made: Harness, seconds: float) -> None:
    made.look(seconds)


def history(made: Harness, live: object) -> list[bytes]:
    """Commands at fixed times, and everything that is seen at some of them."""
    assert callable(live)
    seen = []
    for target, pause_s in ((1.0, 0.4), (-1.0, 0.737), (0.3, 3.0)):
        made.axes.move(0, target, PROFILE)
        made.axes.move(1, -target / 2, PROFILE)
        live(made, pause_s)
        image = made.image
        seen += [image.position.tobytes(), image.velocity.tobytes(), image.torque.tobytes()]
    made.faults.trip(0, 0x7500)
    live(made, 0.2)
    return [*seen, made.image.position.tobytes()]


def test_the_same_commands_at_the_same_times_give_the_same_bits() -> None:
    options = {"velocity_noise_rad_s": 0.01, "torque_noise_nm": 0.1, "seed": 7}
    first, second = (history(harness(**options), look_often) for _ in range(2))
    assert first == second
    assert first != history(harness(**{**options, "seed": 8}), look_often)


def test_what_happens_does_not_depend_on_who_looks_when() -> None:
    assert history(harness(), look_often) == history(harness(), look_rarely)


def test_all_128_axes_move() -> None:
    made = harness(128)
    for axis in range(128):
        made.axes.move(axis, axis / 100, PROFILE)
    image = made.look(3.0)
    assert image.motion_complete.all()
    assert image.position == pytest.approx(np.arange(128) / 100, abs=1e-5)


def test_time_that_nobody_looked_at_is_made_up_for_within_bounds() -> None:
    made = harness(1, max_catch_up_s=0.45)
    made.look(1e6)  # at rest: all of it
    assert made.simulation.world.slips == 0
    made.axes.jog(0, Profile(1.0, 100.0, 100.0))
    image = made.look(1e6)
    assert made.simulation.world.slips == 1
    assert image.position_command[0] == pytest.approx(0.45, abs=0.01)
    assert made.look(1.0).position_command[0] == pytest.approx(1.45, abs=0.01)
