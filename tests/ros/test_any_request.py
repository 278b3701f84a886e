"""Requests with random content: all are answered, rejected ones change nothing."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from std_srvs.srv import SetBool, Trigger
from wmx_ros2_message.srv import (
    EcatGetNetworkState,
    EcatRegisterRead,
    EcatResetStatistics,
    EcatStartHotconnect,
    GetIoBit,
    GetIoBytes,
    GetWmxParams,
    LoadWmxParams,
    SetAxis,
    SetAxisGearRatio,
    SetEngine,
    SetIoBit,
    SetIoBytes,
)

from robotd.device.state import Operation
from robotd.errors import OperationError
from robotd_testing.served_robot import RobotUnderTest

pytestmark = [pytest.mark.daily, pytest.mark.ros]
pytest_plugins = ["robotd_testing.robots"]

SERVICES = {
    "axis/set_on": SetAxis,
    "axis/set_mode": SetAxis,
    "axis/set_polarity": SetAxis,
    "axis/clear_alarm": SetAxis,
    "axis/homing": SetAxis,
    "axis/set_gear_ratio": SetAxisGearRatio,
    "params/load": LoadWmxParams,
    "params/get": GetWmxParams,
    "io/get_input_bit": GetIoBit,
    "io/get_output_bit": GetIoBit,
    "io/get_input_bytes": GetIoBytes,
    "io/get_output_bytes": GetIoBytes,
    "io/set_output_bit": SetIoBit,
    "io/set_output_bytes": SetIoBytes,
    "ecat/get_network_state": EcatGetNetworkState,
    "ecat/register_read": EcatRegisterRead,
    "ecat/reset_statistics": EcatResetStatistics,
    "ecat/start_hotconnect": EcatStartHotconnect,
    "engine/get_status": Trigger,
    "engine/get_fault": Trigger,
    "engine/scan_network": Trigger,
    "engine/set_device": SetEngine,
    "engine/set_comm": SetBool,
}
INTEGERS = st.one_of(st.integers(-1, 6), st.integers(-1, 6), st.integers(-(2**31), 2**31 - 1))
TEXTS = st.one_of(
    st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=30),
    st.sampled_from(["/dev/zero", "/etc/passwd", "../" * 2000, "x" * 300, "/proc/self/mem"]),
    st.just("\x1b[2J"),
)
FIELDS: dict[str, st.SearchStrategy[Any]] = {
    "int32": INTEGERS,
    "double": st.floats(),
    "boolean": st.booleans(),
    "string": TEXTS,
    "uint8": st.integers(0, 255),
}


def field(kind: str) -> st.SearchStrategy[Any]:
    item = FIELDS[kind.removeprefix("sequence<").removesuffix(">")]
    if not kind.startswith("sequence<"):
        return item
    huge = st.integers(7, 50_000).flatmap(lambda count: item.map(lambda value: [value] * count))
    return st.one_of(st.lists(item, max_size=7), st.lists(item, max_size=7), huge)


@st.composite
def requests(draw: st.DrawFn) -> tuple[str, dict[str, Any]]:
    name = draw(st.sampled_from(sorted(SERVICES)))
    kinds = SERVICES[name].Request.get_fields_and_field_types()
    return name, {key: draw(field(kind)) for key, kind in kinds.items()}


@pytest.fixture
def robot(robotd_robot: Callable[..., RobotUnderTest]) -> RobotUnderTest:
    return robotd_robot("cr3a", time_scale=5.0)


def idle(robot: RobotUnderTest) -> bool:
    return bool((robot.robot.image.operation == Operation.IDLE).all())


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=100
)
@given(asked=requests())
def test_any_request(
    robot: RobotUnderTest, robotd_log: Callable[[], str], asked: tuple[str, dict[str, Any]]
) -> None:
    name, fields = asked
    connection, logged = robot.robot.connection, len(robotd_log())
    if not connection.ready:  # an earlier request has stopped it
        connection.open()
        connection.start_communication()
    before = robot.robot.image.copy()
    rejection = None
    try:
        robot.call(SERVICES[name], f"wmx/{name}", **fields)
    except OperationError as error:
        rejection = str(error)
    assert idle(robot), "no service moves an axis"
    if rejection and connection.ready:
        after = robot.robot.image.copy()
        assert (after.servo_on == before.servo_on).all() or name == "axis/set_on"
        assert after.position_command == pytest.approx(before.position_command, abs=1e-3)
    new = robotd_log()[logged:]
    for fault in ("[error", "Traceback", "internal error", "\x1b"):
        assert fault not in new


def test_a_parameter_file_that_is_none(robot: RobotUnderTest, tmp_path: Path) -> None:
    pipe, large, full = tmp_path / "pipe", tmp_path / "large", tmp_path / "full"
    os.mkfifo(pipe)
    large.touch()
    os.truncate(large, 10_000_000_000)
    full.write_text(f"<Parameters>{'<AxisPolarity/>' * 140_000}</Parameters>")
    for path, reason in (
        (pipe, "is no file"),
        (Path("/dev/zero"), "is no file"),
        (tmp_path, "is no file"),
        (large, "larger than the limit of 4_000_000 bytes"),
        (full, "and 950 more problems"),
    ):
        with pytest.raises(OperationError, match=reason):
            robot.call(LoadWmxParams, "wmx/params/load", file_path=str(path))


def test_parameters_of_no_axis_are_those_of_every_axis(robot: RobotUnderTest) -> None:
    every = robot.call(GetWmxParams, "wmx/params/get", index=range(6)).params_dump
    assert robot.call(GetWmxParams, "wmx/params/get").params_dump == every
