"""Opening, communicating, parameters, diagnostics: the engine's life and its rejections."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from robotd.device.axes import Move
from robotd.device.bus_status import BusState
from robotd.device.state import ConnectionState
from robotd.errors import (
    ConnectError,
    DescriptorError,
    NotReady,
    OperationError,
    RobotdError,
)
from robotd.motion.profile import Profile
from robotd.robot import Robot, build_robot, open_robot
from robotd_wmx import _native
from robots import ROBOTS, descriptor, eventually, running
from standin_port import port


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return build_robot(descriptor(tmp_path, lock_timeout_s=2.0), "wmx")


@pytest.mark.parametrize("lock", ["device_locked", "process_locked", "name_rejected"])
def test_a_locked_engine_is_tried_again(robot: Robot, lock: str) -> None:
    port(lock, 3)
    robot.connection.open()
    assert robot.connection.state is ConnectionState.RUNNING
    robot.connection.shutdown()


def test_no_engine_at_the_path_is_said_at_once(robot: Robot) -> None:
    with pytest.raises(ConnectError, match=r"wmx 272 \(there is no engine program at this path\)"):
        robot.connection.open(path="/nowhere")
    assert robot.connection.state is ConnectionState.IDLE


def test_a_slow_engine_is_waited_for(robot: Robot) -> None:
    port("idle_ms", 300)
    robot.connection.open()
    assert robot.connection.state is ConnectionState.RUNNING
    robot.connection.shutdown()


def test_a_link_that_is_not_up_yet_is_tried_again(tmp_path: Path) -> None:
    port("communication_rejected", 3)
    with running(tmp_path) as robot:
        assert robot.connection.ready


def test_our_devices_are_named_after_the_robot_and_closed(tmp_path: Path) -> None:
    with running(tmp_path):
        device = _native.Device()
        device.create(_native.SDK_PATH, 1000)
        names = [name for _, name in device.devices()]
        assert names == ["cr3a", "cr3a.status", "cr3a.stream", "cr3a.diagnostics", ""]
    # Another program's device keeps the engine alive.
    assert device.state() is _native.State.RUNNING
    assert [name for _, name in device.devices()] == [""]
    device.close(False)


def test_parameters_of_the_file_are_in_force(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        text = robot.connection.dump_parameters(0)
    assert "52953088" in text
    assert "AxisPolarity" in text


def test_no_communication_with_parameters_that_cannot_be_loaded(tmp_path: Path) -> None:
    path = descriptor(tmp_path)
    data = yaml.safe_load(path.read_text("utf-8"))
    bad = tmp_path / "bad.xml"
    bad.write_text(Path(data["parameters_file"]).read_text("utf-8").replace("52953088", "-1"))
    path.write_text(yaml.safe_dump(data | {"parameters_file": str(bad)}), "utf-8")
    robot = build_robot(path, "wmx")
    robot.connection.open()
    with pytest.raises(DescriptorError, match="AxisGearRatioNumerator"):
        robot.connection.start_communication()
    assert "state 1 cycle 0" in port("show")
    robot.shutdown()


def test_no_communication_with_the_default_gear_ratio(tmp_path: Path) -> None:
    path = descriptor(tmp_path)
    data = yaml.safe_load(path.read_text("utf-8"))
    del data["parameters_file"]
    path.write_text(yaml.safe_dump(data), "utf-8")
    robot = build_robot(path, "wmx")
    robot.connection.open()
    with pytest.raises(NotReady, match=r"axes \[0, 1, 2, 3, 4, 5\] have .* gear ratio 1/1"):
        robot.connection.start_communication()
    assert "state 1 cycle 0" in port("show")
    robot.shutdown()


def test_missing_elements_become_defaults_not_zeros(tmp_path: Path) -> None:
    original = (ROBOTS / "cr3a" / "wmx_parameters.xml").read_text("utf-8")
    lines = [line for line in original.splitlines() if "<QuickStopDec>" not in line]
    partial = tmp_path / "partial.xml"
    partial.write_text("\n".join(lines), "utf-8")
    with running(tmp_path, enable=False) as robot:
        robot.connection.load_parameters(partial)
        lines = robot.connection.dump_parameters(0).splitlines()
        assert "100000" in next(line for line in lines if "QuickStopDec" in line)


def test_a_bad_parameter_file_changes_nothing(tmp_path: Path) -> None:
    original = (ROBOTS / "cr3a" / "wmx_parameters.xml").read_text("utf-8")
    bad = tmp_path / "bad.xml"
    bad.write_text(original.replace("52953088.000000", "-1.0"), "utf-8")
    with running(tmp_path, enable=False) as robot:
        before = robot.connection.dump_parameters(0)
        with pytest.raises(DescriptorError, match="AxisGearRatioNumerator"):
            robot.connection.load_parameters(bad)
        assert robot.connection.dump_parameters(0) == before


def test_a_load_changes_no_scale_of_a_live_axis(tmp_path: Path) -> None:
    original = (ROBOTS / "cr3a" / "wmx_parameters.xml").read_text("utf-8")
    same, other = tmp_path / "same.xml", tmp_path / "other.xml"
    same.write_text(original.replace("100000.000000</QuickStopDec>", "50.0</QuickStopDec>"))
    other.write_text(original.replace("52953088.000000", "1.0"))
    with running(tmp_path) as robot:
        where, before = robot.image.position.copy(), robot.connection.dump_parameters(0)
        with pytest.raises(NotReady, match=r"axis 0 would change AxisGearRatioNumerator /"):
            robot.connection.load_parameters(other)
        assert robot.connection.dump_parameters(0) == before
        np.testing.assert_allclose(robot.image.position, where, atol=1e-4)
        robot.connection.load_parameters(same)
        assert "50.0" in robot.connection.dump_parameters(0)
        robot.axes.set_command_mode(2, 1)
        with pytest.raises(NotReady, match="axis 2 would change AxisCommandMode from 1 to 0"):
            robot.connection.load_parameters(same)


def test_a_file_without_axes_of_the_robot_is_rejected(tmp_path: Path) -> None:
    original = (ROBOTS / "cr3a" / "wmx_parameters.xml").read_text("utf-8")
    start, end = original.index('<AxisParameters Axis="4"'), original.index("</Parameters>")
    partial = tmp_path / "partial.xml"
    partial.write_text(original[:start] + original[end:])
    with running(tmp_path, enable=False) as robot:
        before = robot.connection.dump_parameters(4)
        with pytest.raises(DescriptorError, match=r"axes 4\.\.5 of a robot with 6 axes"):
            robot.connection.load_parameters(partial)
        assert robot.connection.dump_parameters(4) == before


def test_polarity_and_gear_ratio_change_the_measured_position(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.move([Move(0, 0.5, Profile(2.0, 12.0, 12.0))])
        eventually(lambda: bool(robot.image.motion_complete[0]))
        robot.axes.servo(0, False)
        robot.axes.set_polarity(0, 1)
        eventually(lambda: abs(robot.image.position[0] + 0.5) < 1e-5)
        robot.axes.set_gear_ratio(0, 2 * 52953088.0, 6.283185307179586)
        eventually(lambda: abs(robot.image.position[0] + 0.25) < 1e-5)


def test_homing_makes_the_present_position_zero(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.move([Move(0, 0.5, Profile(2.0, 12.0, 12.0))])
        eventually(lambda: bool(robot.image.motion_complete[0]))
        robot.axes.home(0)
        eventually(lambda: abs(robot.image.position[0]) < 1e-5)
        assert robot.image.home_done[0]


def test_enabling_makes_no_jump_where_the_arm_has_sagged(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        robot.axes.servo(1, False)
        port("push", 1, 200_000)
        eventually(lambda: abs(robot.image.position[1]) > 0.02)
        where = float(robot.image.position[1])
        robot.axes.servo(1, True)
        assert robot.image.position_command[1] == pytest.approx(where, abs=1e-5)
        assert robot.image.position[1] == pytest.approx(where, abs=1e-5)


def test_registers_statistics_and_network(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        network = robot.fieldbus.status(0)
        assert (network.state, len(network.nodes), network.axes) == (BusState.OPERATIONAL, 7, 6)
        assert (network.nodes[6].output_size, network.period_s) == (8, pytest.approx(0.001))
        assert robot.fieldbus.read_register(0, 2, 0x0130, 2) == b"\x08\x00"
        port("slave_lost", 1)
        assert robot.fieldbus.status(0).lost_frames > 0
        robot.fieldbus.reset_statistics(0)
        assert robot.fieldbus.status(0).lost_frames == 0
        with pytest.raises(OperationError, match=r"wmx 8197"):
            robot.fieldbus.read_register(0, 1, 0, 1)
        assert "no answer from 1" in robot.connection.scan_network()


def test_objects_of_a_slave(tmp_path: Path) -> None:
    window = (0, 2, 0x6065, 0)
    with running(tmp_path) as robot:
        fieldbus = robot.fieldbus
        assert fieldbus.read_object(0, 2, 0x1000) == b"\x92\x01\x02\x00"
        fieldbus.write_object(*window, b"\x40\x1f\x00\x00")
        assert fieldbus.read_object(*window) == b"\x40\x1f\x00\x00"
        assert fieldbus.read_object(0, 3, 0x6065) != b"\x40\x1f\x00\x00"
        for code, write in (
            (0x06020000, lambda: fieldbus.write_object(0, 2, 0x5FFF, 0, b"\x01")),
            (0x06010002, lambda: fieldbus.write_object(0, 2, 0x1000, 0, bytes(4))),
            (0x06070010, lambda: fieldbus.write_object(*window, b"\x01")),
        ):
            text = rf"master 0 slave 2: writing .* aborts with 0x{code:08X}"
            with pytest.raises(OperationError, match=text) as caught:
                write()
            assert caught.value.code == code
        port("slave_lost", 1)
        with pytest.raises(OperationError, match=r"slave 1: reading 0x1000:00: wmx 8197"):
            fieldbus.read_object(0, 1, 0x1000)


def test_inputs_and_outputs(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        port("input", 4, 0xA5)
        assert robot.io.input_bytes(4, 1) == b"\xa5"
        robot.io.set_output_bytes(0, b"\x01\x02\x03")
        robot.io.set_output_bit(1, 0, True)
        assert robot.io.output_bytes(0, 3) == b"\x01\x03\x03"
        assert robot.io.output_bit(1, 1)
        with pytest.raises(RobotdError, match=r"outside 0\.\.7999"):
            robot.io.output_bytes(7999, 2)


def test_the_last_inputs_and_outputs_are_known_without_an_engine(tmp_path: Path) -> None:
    with running(tmp_path) as robot:
        told = robot.io.output_watcher(1, 0)
        assert not told()
        robot.io.set_output_bit(1, 0, True)
        assert told()
        robot.connection.close()
        assert told()


def test_rated_torque_makes_percent_newton_metres(tmp_path: Path) -> None:
    path = descriptor(tmp_path)
    data = yaml.safe_load(path.read_text("utf-8"))
    data["joints"][0]["rated_torque_nm"] = 40.0
    path.write_text(yaml.safe_dump(data), "utf-8")
    with open_robot(path, "wmx") as robot:
        port("torque", 0, 25)
        eventually(lambda: abs(robot.image.torque[0] - 10.0) < 1e-9)
        assert np.isnan(robot.image.torque[1])
