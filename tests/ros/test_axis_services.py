"""wmx/axis and wmx/params services: what they do, and what they refuse before doing anything."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.ros.robot_process import BACKEND, Client, stamp_s, wait_until
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import GetWmxParams, LoadWmxParams, SetAxis, SetAxisGearRatio

pytestmark = [pytest.mark.daily, pytest.mark.ros, pytest.mark.second_backend]


ROBOTS = Path(__file__).parents[2] / "robots"


@pytest.fixture(scope="module")
def states(client: Client) -> list[Any]:
    return client.listen(AxisState, "/wmx/axis/state")


def set_axis(client: Client, name: str, index: list[int], data: list[int]) -> Any:
    return client.call(SetAxis, f"/wmx/axis/{name}", index=index, data=data)


def test_servo_off_and_on_again(client: Client, states: list[Any]) -> None:
    response = set_axis(client, "set_on", [1, 4], [0, 0])
    assert (response.success, response.message) == (True, "joint2: ok; joint5: ok")
    state = client.next(states, lambda message: not message.servo_on[1])
    assert list(state.servo_on) == [True, False, True, True, False, True]
    before = list(state.actual_pos)
    response = set_axis(client, "set_on", [1, 4], [1, 1])
    assert response.success, response.message
    state = client.next(states, lambda message: all(message.servo_on))
    assert list(state.actual_pos) == pytest.approx(before, abs=1e-3)


def test_each_axis_is_named_with_its_own_outcome(client: Client, states: list[Any]) -> None:
    set_axis(client, "set_on", [2], [0])
    client.next(states, lambda message: not message.servo_on[2])
    response = set_axis(client, "set_polarity", [2, 3], [1, 1])
    assert not response.success
    assert response.message.startswith("joint3: ok; joint4: polarity can change only while")
    assert set_axis(client, "set_on", [2], [1]).success


def test_commands_without_data(client: Client) -> None:
    assert set_axis(client, "clear_alarm", [0], []).message == "joint1: ok"


def test_mode_velocity_and_back(client: Client) -> None:
    assert set_axis(client, "set_mode", [5], [1]).success
    assert set_axis(client, "set_mode", [5], [0]).success


@pytest.mark.parametrize(
    ("name", "index", "data", "reason"),
    [
        ("set_on", [], [], "no axis given"),
        ("set_on", [0, 1], [1], "data has 1 values for 2 axes"),
        ("set_on", [6], [1], "axis 6 is outside 0..5"),
        ("set_on", [-1], [1], "axis -1 is outside 0..5"),
        ("set_on", [2, 2], [0, 0], "axis 2 is given twice"),
        ("set_on", [0, 1], [0, 2], "axis 1: data 2 is not 0 or 1"),
        ("set_mode", [0], [7], "joint1: mode 7 is not 0, 1 or 2"),
        ("set_mode", [0], [2], f"torque mode: not supported by the {BACKEND} backend"),
        ("set_polarity", [0], [0], "joint1: polarity 0 is not 1 or -1"),
        ("clear_alarm", [9], [], "axis 9 is outside 0..5"),
        ("homing", [0, 0], [], "axis 0 is given twice"),
    ],
)
def test_bad_requests_are_rejected_with_the_reason(
    client: Client, name: str, index: list[int], data: list[int], reason: str
) -> None:
    response = set_axis(client, name, index, data)
    assert not response.success
    assert reason in response.message


def test_a_rejected_request_does_nothing_to_any_axis(client: Client, states: list[Any]) -> None:
    assert not set_axis(client, "set_on", [0, 99], [0, 0]).success
    client.next(states)
    assert all(client.next(states).servo_on)


@pytest.mark.parametrize(
    ("numerator", "denominator", "reason"),
    [
        ([0.0], [1.0], "numerator 0.0 is outside 1e-06.."),
        ([1.0], [0.0], "denominator 0.0 is outside 1e-06.."),
        ([float("nan")], [1.0], "numerator nan is outside 1e-06.."),
        ([float("inf")], [1.0], "numerator inf is outside 1e-06.."),
        ([1.0], [], "denominator has 0 values for 1 axes"),
        ([1.0], [1.0], "can change only while the servo is off"),
    ],
)
def test_bad_gear_ratios(
    client: Client, numerator: list[float], denominator: list[float], reason: str
) -> None:
    response = client.call(
        SetAxisGearRatio,
        "/wmx/axis/set_gear_ratio",
        index=[0],
        numerator=numerator,
        denominator=denominator,
    )
    assert not response.success
    assert reason in response.message


def test_gear_ratio_and_homing_of_a_disabled_axis(client: Client) -> None:
    assert set_axis(client, "set_on", [5], [0]).success
    response = client.call(
        SetAxisGearRatio,
        "/wmx/axis/set_gear_ratio",
        index=[5],
        numerator=[42467328.0],
        denominator=[6.283185307179586],
    )
    assert (response.success, response.message) == (True, "joint6: ok")
    assert set_axis(client, "set_on", [5], [1]).success


def test_homing_makes_the_present_position_zero(client: Client, states: list[Any]) -> None:
    response = set_axis(client, "homing", [5], [])
    assert (response.success, response.message) == (True, "joint6: ok")
    state = client.next(states, lambda message: message.home_done[5])
    assert state.actual_pos[5] == pytest.approx(0.0, abs=1e-3)


def test_parameters_can_be_read(client: Client) -> None:
    response = client.call(GetWmxParams, "/wmx/params/get", index=[0, 3])
    assert response.success
    lines = list(response.params_dump)
    first, second = lines.index("=== Axis 0 ==="), lines.index("=== Axis 3 ===")
    assert first == 0
    assert any("52953088" in line for line in lines[first:second])
    assert not any("\n" in line for line in lines)


@pytest.mark.parametrize("path", ["", "/nowhere/parameters.xml"])
def test_loading_a_missing_parameter_file_is_rejected(client: Client, path: str) -> None:
    response = client.call(LoadWmxParams, "/wmx/params/load", file_path=path)
    assert not response.success
    assert (path or "file_path") in response.message


def test_state_carries_stamp_frame_and_all_axes(client: Client, states: list[Any]) -> None:
    state = client.next(states)
    assert state.header.frame_id == "base_link"
    assert stamp_s(state) == pytest.approx(client.now_ns * 1e-9, abs=2.0)
    for field in ("amp_alarm", "servo_on", "motion_complete", "pos_cmd", "actual_torque"):
        assert len(getattr(state, field)) == 6
    wait_until(lambda: len(states) > 50, "a stream of states", 5.0)


def test_a_load_never_changes_the_scale_of_a_live_axis(
    client: Client, states: list[Any], tmp_path: Path
) -> None:
    original = (ROBOTS / "cr3a" / "wmx_parameters.xml").read_text(encoding="utf-8")
    path = tmp_path / "parameters.xml"
    path.write_text(original.replace("52953088.000000", "1.0"), encoding="utf-8")
    before = client.next(states, lambda message: all(message.servo_on))
    response = client.call(LoadWmxParams, "/wmx/params/load", file_path=str(path))
    assert not response.success
    assert "axis 0 would change AxisGearRatioNumerator" in response.message
    after = client.next(states)
    assert list(after.actual_pos) == pytest.approx(list(before.actual_pos), abs=1e-3)


def test_a_load_tells_what_the_file_lacks(client: Client, tmp_path: Path) -> None:
    original = (ROBOTS / "cr3a" / "wmx_parameters.xml").read_text(encoding="utf-8")
    path = tmp_path / "parameters.xml"
    lines = [line for line in original.splitlines() if "<QuickStopDec>" not in line]
    path.write_text("\n".join(lines), encoding="utf-8")
    assert set_axis(client, "set_on", [5], [0]).success  # homing may have moved its zero
    response = client.call(LoadWmxParams, "/wmx/params/load", file_path=str(path))
    assert set_axis(client, "set_on", [5], [1]).success
    assert response.success, response.message
    missing = "missing elements, which get their defaults: axes 0..5: QuickStopDec"
    assert response.message == f"{path} loaded; {missing}"
    start, end = original.index('<AxisParameters Axis="4"'), original.index("</Parameters>")
    path.write_text(original[:start] + original[end:], encoding="utf-8")
    response = client.call(LoadWmxParams, "/wmx/params/load", file_path=str(path))
    assert not response.success
    assert "nothing is stated for axes 4..5 of a robot with 6 axes" in response.message
