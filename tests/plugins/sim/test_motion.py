from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.plugins.sim.harness import PROFILE, TICK_S, harness

from robotd.api import CommandMode, NotReady, Operation, Profile, Unsupported


def test_a_move_arrives_exactly_and_is_complete_in_the_cycle_in_which_it_ends() -> None:
    made = harness()
    made.axes.move(0, 3.0, PROFILE)
    image = made.look()
    assert image.operation[0] == Operation.POSITION
    assert not image.motion_complete[0]
    image = made.look(1.874)
    assert image.operation[0] == Operation.POSITION
    image = made.look(0.001)
    assert image.operation[0] == Operation.IDLE
    assert image.motion_complete[0]
    assert image.position_command[0] == 3.0
    assert made.look(0.2).position[0] == pytest.approx(3.0, abs=1e-5)
    assert image.position[1] == 0


def test_a_move_to_where_the_axis_is_completes_at_once() -> None:
    made = harness()
    made.axes.move(0, 0.0, PROFILE)
    assert made.look(TICK_S).motion_complete[0]


@settings(max_examples=25, deadline=None)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.01, 1.5))
def test_an_override_is_continuous_and_keeps_the_limits(
    first: float, second: float, at_s: float
) -> None:
    made = harness(1)
    made.set(ProhibitOvertravel=0)
    made.axes.move(0, first, PROFILE)
    before = made.record(at_s)
    made.axes.move(0, second, PROFILE)
    after = made.record(4.0)
    velocity = np.concatenate([before.command_velocity, after.command_velocity])[:, 0]
    command = np.concatenate([before.command, after.command])[:, 0]
    assert np.abs(np.diff(velocity)).max() <= PROFILE.acceleration * TICK_S + 1e-9
    assert np.abs(velocity).max() <= PROFILE.velocity + 1e-9
    assert np.abs(np.diff(command)).max() <= PROFILE.velocity * TICK_S + 1e-9
    assert command[-1] == second


def test_a_stop_brakes_with_the_deceleration_of_the_command() -> None:
    made = harness()
    made.axes.jog(0, PROFILE)
    start = made.look(1.0).position_command[0]
    made.axes.stop([0, 1])
    record = made.record(0.6)
    braking = record.operation[:, 0] == Operation.STOPPING
    assert braking.sum() * TICK_S == pytest.approx(0.5, abs=2 * TICK_S)
    assert record.command[-1, 0] - start == pytest.approx(0.5, abs=1e-6)
    assert not made.image.motion_complete[0]
    assert made.image.operation[1] == Operation.IDLE


def test_a_quick_stop_takes_over_a_stop_but_not_the_other_way_round() -> None:
    made = harness()
    made.set(QuickStopDec=40.0)
    made.axes.jog(0, PROFILE)
    start = made.look(1.0).position_command[0]
    made.axes.stop([0])
    made.axes.quick_stop([0])
    made.axes.stop([0])
    image = made.look(0.051)
    assert image.operation[0] == Operation.IDLE
    assert image.position_command[0] - start == pytest.approx(0.05, abs=1e-6)


def test_a_velocity_command_of_zero_slows_to_rest_and_leaves_the_axis_idle() -> None:
    made = harness()
    made.axes.set_command_mode(0, CommandMode.VELOCITY)
    made.axes.jog(0, Profile(-1.0, 10.0, 5.0))
    image = made.look(0.5)
    assert image.operation[0] == Operation.VELOCITY
    assert image.velocity[0] == pytest.approx(-1.0, abs=1e-3)
    assert image.position_command[0] == image.position[0]  # the engine's rule in this mode
    made.axes.jog(0, Profile(0.0, 10.0, 5.0))
    assert made.look(0.1).operation[0] == Operation.VELOCITY
    image = made.look(0.15)
    assert image.operation[0] == Operation.IDLE
    assert not image.motion_complete[0]


def test_commands_are_rejected_with_the_reason() -> None:
    made = harness()
    with pytest.raises(Unsupported, match="torque mode"):
        made.axes.set_command_mode(0, CommandMode.TORQUE)
    made.axes.move(0, 1.0, PROFILE)
    with pytest.raises(NotReady, match=r"axis 0: its mode cannot be changed.*position"):
        made.axes.set_command_mode(0, CommandMode.VELOCITY)
    made.axes.stop([0])
    with pytest.raises(NotReady, match="axis 0: takes no command while it is stopping"):
        made.axes.move(0, 1.0, PROFILE)
    made.axes.set_command_mode(1, CommandMode.VELOCITY)
    with pytest.raises(NotReady, match="axis 1: in velocity mode, not in position mode"):
        made.axes.move(1, 1.0, PROFILE)
    made.axes.servo(1, False, 1.0)
    with pytest.raises(NotReady, match="axis 1: the servo is off"):
        made.axes.jog(1, PROFILE)
    made.device.stop_communication(1.0)
    with pytest.raises(NotReady, match="not communicating"):
        made.axes.move(0, 1.0, PROFILE)
