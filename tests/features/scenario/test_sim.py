"""``robotd sim run`` and what ``inject`` makes of its words; the rest needs ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import Result

from robotd.cli.exit_codes import ExitCode
from robotd_ros.failed_requests import value_of

Robotd = Callable[..., Result]

MOVE = """
schema: 1
robot: cr3a
faults:
  - {at_s: 0.2, packet_loss: {count: 3}}
program:
  - move: {to_rad: {joint1: 0.2}, time_s: 0.5}
"""


def scenario(folder: Path, text: str) -> str:
    path = folder / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_a_scenario_that_passes_tells_every_step(robotd: Robotd, tmp_path: Path) -> None:
    result = robotd("sim", "run", scenario(tmp_path, MOVE), "--log-level", "warning")
    assert result.exit_code == ExitCode.OK, result.output
    for text in ("ok    move joint1=0.2 in 0.5 s", "fault  packet_loss count=3", "passed"):
        assert text in result.stdout


def test_a_scenario_that_fails_says_why(robotd: Robotd, tmp_path: Path) -> None:
    text = MOVE + "  - check: {joints_rad: {joint1: 0.3}}\n"
    result = robotd("sim", "run", scenario(tmp_path, text))
    assert result.exit_code == ExitCode.FAILED
    assert "joint1 is at" in result.stdout
    assert "passed" not in result.stdout


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (MOVE + "nonsense: 1\n", "nonsense: unknown key"),
        (MOVE.replace("robot: cr3a", ""), "names no robot, and none is given by --robot"),
        (MOVE.replace("packet_loss: {count: 3}", "amp_alarm: {axis: 9}"), "axis 9 is outside 0..5"),
        (MOVE.replace("joint1: 0.2", "joint1: 99"), ""),
    ],
)
def test_a_wrong_file_is_told_before_anything_moves(
    robotd: Robotd, tmp_path: Path, text: str, error: str
) -> None:
    result = robotd("sim", "run", scenario(tmp_path, text))
    assert result.exit_code == (ExitCode.CONFIGURATION if error else ExitCode.FAILED)
    assert error in result.stderr


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "inf", "1001", "fast"])
def test_a_scale_that_makes_no_sense_is_a_usage_error(
    robotd: Robotd, tmp_path: Path, scale: str
) -> None:
    result = robotd("sim", "run", scenario(tmp_path, MOVE), "--time-scale", scale)
    assert result.exit_code == ExitCode.USAGE
    assert "neither max nor a number from 0.01 to 1000" in result.stderr


def asked_of_robot(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """Answer the calls of ``robotd sim`` with "done"; return where they are recorded."""
    asked: list[tuple[str, Any]] = []

    def call(service_type: Any, name: str, /, **fields: Any) -> Any:
        request = service_type.Request(**fields)
        asked.append((name, request))
        return SimpleNamespace(message="done")

    client = SimpleNamespace(call=call)
    place = "robotd_scenario.sim_command"
    monkeypatch.setattr(f"{place}.require_one_robot", lambda client: None)
    monkeypatch.setattr(f"{place}.robot_client", lambda timeout_s: nullcontext(client))
    return asked


@pytest.mark.parametrize(
    ("words", "fields"),
    [
        (["amp_alarm", "axis=2", "code=0x2310", "at_s=1.5"],
         {"axis": 2, "code": 0x2310, "at_s": 1.5}),
        (["engine_stopped", "when.joint=joint1", "when.above_rad=0.5"],
         {"when.joint": "joint1", "when.above_rad": 0.5}),
        (["stuck_gripper", "closed=true"], {"closed": True}),
    ],
)  # fmt: skip
def test_words_become_fields(
    robotd: Robotd, monkeypatch: pytest.MonkeyPatch, words: list[str], fields: dict[str, Any]
) -> None:
    asked = asked_of_robot(monkeypatch)
    result = robotd("sim", "inject", *words)
    assert result.exit_code == 0, result.output
    assert result.stdout == "done\n"
    ((name, request),) = asked
    assert (name, request.kind) == ("robotd_sim/inject", words[0])
    assert {setting.name: value_of(setting) for setting in request.settings} == fields


@pytest.mark.parametrize(
    ("value", "reason"), [("axis=3", "axis is given twice"), ("code=1_0", "'1_0' is not a number")]
)
def test_a_repeated_key_and_a_number_with_underscores_are_usage_errors(
    robotd: Robotd, value: str, reason: str
) -> None:
    result = robotd("sim", "inject", "amp_alarm", "axis=2", value)
    assert (result.exit_code, reason in result.stderr) == (ExitCode.USAGE, True)


@pytest.mark.parametrize("words", [["nonsense"], ["amp_alarm", "axis"], ["amp_alarm", "=2"]])
def test_words_that_say_nothing_are_usage_errors(robotd: Robotd, words: list[str]) -> None:
    assert robotd("sim", "inject", *words).exit_code == ExitCode.USAGE


def test_an_object_is_placed_by_its_name(robotd: Robotd, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = asked_of_robot(monkeypatch)
    for words in (["x=0.4", "yaw=-1"], ["y=-1"]):
        result = robotd("sim", "place", "cube", *words)
        assert (result.exit_code, result.stdout) == (0, "done\n"), result.output
    assert [(name, request.name) for name, request in asked] == [("robotd_world/place", "cube")] * 2
    turned, moved = (request for _, request in asked)
    assert [*turned.position] == pytest.approx([0.4, math.nan, math.nan], nan_ok=True)
    assert [*turned.rpy] == [0.0, 0.0, -1.0]
    assert [*moved.position] == pytest.approx([math.nan, -1.0, math.nan], nan_ok=True)
    assert [*moved.rpy] == []


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ([], "Missing argument"),
        (["w=1"], "w is none of x, y, z, roll, pitch, yaw"),
        (["x=true"], "x: True is not a number"),
        (["x=far"], "x: 'far' is not a number"),
        (["x=nan"], "x: nan is not a number"),
    ],
)
def test_a_wrong_place_is_a_usage_error(robotd: Robotd, words: list[str], reason: str) -> None:
    result = robotd("sim", "place", "cube", *words)
    assert (result.exit_code, reason in result.stderr) == (ExitCode.USAGE, True), result.stderr
