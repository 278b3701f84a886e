from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from tests.plugins.sim.harness import PROFILE, closed_rig, harness

import robotd_sim
from robotd.api import (
    Capability,
    CommandMode,
    ConnectError,
    ConnectionState,
    DescriptorError,
    DeviceTimeout,
    NotReady,
    Operation,
    Profile,
)
from robotd_sim.options import SimOptions
from robotd_wmx_parameters import default_wmx_parameters, write_wmx_parameters


def test_the_backend_describes_itself() -> None:
    info = robotd_sim.robotd_backend()
    assert Capability.DEVICE_WATCHDOG in info.capabilities
    assert Capability.TORQUE_MODE not in info.capabilities
    assert info.api_version == 1
    assert info.options is SimOptions


def test_the_engine_goes_through_its_states() -> None:
    made = closed_rig()
    device = made.device
    assert device.state() is ConnectionState.IDLE
    with pytest.raises(NotReady, match="no device is open"):
        device.start_communication(1.0)
    device.open()
    assert device.state() is ConnectionState.RUNNING
    device.start_communication(1.0)
    assert device.state() is ConnectionState.COMMUNICATING
    device.stop_communication(1.0)
    assert device.state() is ConnectionState.RUNNING
    device.close()
    device.close()
    assert device.state() is ConnectionState.IDLE


def test_opening_fails_as_often_as_asked_for() -> None:
    device = closed_rig(fail_open=2).device
    for _ in range(2):
        with pytest.raises(ConnectError, match="engine: device locked"):
            device.open()
    device.open()
    assert device.state() is ConnectionState.RUNNING


def test_a_late_start_of_communication_stays_pending_unless_it_is_stopped() -> None:
    made = closed_rig(communication_delay_s=0.5)
    made.device.open()
    with pytest.raises(DeviceTimeout, match=r"within 0.1 s"):
        made.device.start_communication(0.1)
    made.clock.advance(0.5)
    assert made.device.state() is ConnectionState.COMMUNICATING
    made.device.stop_communication(1.0)
    with pytest.raises(DeviceTimeout):
        made.device.start_communication(0.1)
    made.device.stop_communication(1.0)
    made.clock.advance(5.0)
    assert made.device.state() is ConnectionState.RUNNING


def test_values_are_unknown_before_and_stale_after_communication() -> None:
    made = closed_rig()
    made.device.open()
    image = made.look()
    assert np.isnan(image.position).all()
    assert image.offline.all()
    assert image.fresh_ns == 0
    made.device.start_communication(1.0)
    image = made.look(1.0)
    assert image.position == pytest.approx([0.0, 0.0])
    assert not image.offline.any()
    fresh_ns = image.fresh_ns
    assert 0 <= made.clock.now_ns() - fresh_ns < 1_000_000
    made.faults.drop_communication()
    image = made.look(1.0)
    assert image.fresh_ns == fresh_ns
    assert image.offline.all()
    assert made.device.state() is ConnectionState.RUNNING


def test_stopping_communication_brakes_before_the_servos_go_off() -> None:
    made = harness()
    made.set(AbsoluteEncoderMode=1, QuickStopDec=10.0)
    made.axes.jog(0, PROFILE)
    position = made.look(1.0).position[0]
    made.device.stop_communication(1.0)
    image = made.look(1.0)
    assert not image.servo_on.any()
    made.device.start_communication(1.0)
    assert made.look().position[0] - position == pytest.approx(0.2, abs=0.005)


def test_parameters_are_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    made = harness(on=False)
    good, bad = tmp_path / "good.xml", tmp_path / "bad.xml"
    changed = default_wmx_parameters().with_values(
        {"AxisPolarity": {0: -1}, "AxisGearRatioNumerator": {0: 5000.0}, "QuickStopDec": {0: 7.0}}
    )
    write_wmx_parameters(changed, good)
    text = good.read_text()
    bad.write_text(text.replace("<QuickStopDec>7.000000", "<QuickStopDec>-7.000000"))
    before = made.device.dump_parameters(0)
    with pytest.raises(DescriptorError, match="QuickStopDec"):
        made.device.load_parameters(bad)
    assert made.device.dump_parameters(0) == before
    made.device.load_parameters(good)
    assert "QuickStopDec = 7" in made.device.dump_parameters(0).splitlines()
    assert "AxisPolarity = -1" in made.device.dump_parameters(0).splitlines()
    made.device.close()
    assert made.device.dump_parameters(0) == before
    with pytest.raises(NotReady, match="no device is open"):
        made.device.load_parameters(good)


def test_parameters_are_rejected_while_an_axis_moves(tmp_path: Path) -> None:
    made = harness()
    write_wmx_parameters(default_wmx_parameters(), tmp_path / "parameters.xml")
    made.axes.move(1, 1.0, PROFILE)
    with pytest.raises(NotReady, match="axis 1: parameters cannot be loaded while it is moving"):
        made.device.load_parameters(tmp_path / "parameters.xml")


def test_a_load_never_changes_the_scale_of_a_live_axis(tmp_path: Path) -> None:
    made = harness()
    path = tmp_path / "parameters.xml"
    in_force = made.device.simulation.parameters
    write_wmx_parameters(in_force.with_values({"AxisPolarity": {1: -1}}), path)
    before = made.device.dump_parameters(1)
    with pytest.raises(NotReady, match="axis 1 would change AxisPolarity from 1 to -1"):
        made.device.load_parameters(path)
    assert made.device.dump_parameters(1) == before
    made.axes.set_command_mode(0, CommandMode.VELOCITY)
    write_wmx_parameters(in_force, path)
    with pytest.raises(NotReady, match="axis 0 would change AxisCommandMode from 1 to 0"):
        made.device.load_parameters(path)
    made.axes.set_command_mode(0, CommandMode.POSITION)
    write_wmx_parameters(in_force.with_values({"QuickStopDec": {1: 7.0}}), path)
    made.device.load_parameters(path)
    assert "QuickStopDec = 7" in made.device.dump_parameters(1)


def test_a_load_never_undoes_the_homing_of_a_live_axis(tmp_path: Path) -> None:
    made = harness(on=False)
    path = tmp_path / "parameters.xml"
    in_force = made.device.simulation.parameters
    write_wmx_parameters(in_force.with_values({"AbsoluteEncoderMode": {0: 1}}), path)
    made.device.load_parameters(path)
    made.axes.servo(0, True, 1.0)
    made.axes.move(0, 0.5, PROFILE)
    made.look(2.0)
    made.axes.home(0, 1.0)
    with pytest.raises(NotReady, match="axis 0 would change AbsoluteEncoderHomeOffset"):
        made.device.load_parameters(path)
    assert made.look().position[0] == pytest.approx(0.0, abs=1e-3)


def test_options_that_do_not_fit_the_robot_are_rejected() -> None:
    with pytest.raises(DescriptorError, match=r"sim.bandwidth_hz: has 3 figures, .* 0 to "):
        closed_rig(2, bandwidth_hz=(1.0, 2.0, 3.0))
    with pytest.raises(DescriptorError, match=r"sim.limit_switches: axis 2 does not exist"):
        closed_rig(2, limit_switches={2: {"positive_rad": 1.0}})
    with pytest.raises(ValidationError, match="greater than or equal to 0"):
        closed_rig(2, seed=-1)


def test_a_velocity_command_ends_when_nothing_reads_the_values() -> None:
    """As in a stall of robotd: it has no end of its own, as a move has."""
    made = harness()
    made.axes.move(0, 2.0, Profile(velocity=1.0, acceleration=8.0, deceleration=4.0))
    made.axes.jog(1, Profile(velocity=1.0, acceleration=8.0, deceleration=4.0))
    made.look(0.2)
    made.clock.advance(3.0)
    image = made.look()
    assert image.operation[:2].tolist() == [Operation.IDLE, Operation.IDLE]
    assert image.position_command[:2] == pytest.approx([2.0, 0.76], abs=0.02)
    assert "stands still" in image.reason[1]


def test_a_velocity_command_goes_on_while_the_values_are_read() -> None:
    made = harness()
    made.axes.jog(0, Profile(velocity=1.0, acceleration=8.0, deceleration=4.0))
    for _ in range(10):
        image = made.look(0.3)
    assert image.operation[0] == Operation.VELOCITY
