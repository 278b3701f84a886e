"""Guards of a robot are made with it, and a key that nothing uses is named."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from structlog.testing import capture_logs

from robotd import Robot, open_robot
from robotd.api import DescriptorError
from robotd.cli.exit_codes import ExitCode
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor
from robotd.feature import _loaded
from robotd.guards import requested_guards
from robotd.plugin.manager import load_backend
from robotd.robot import build_robot
from robotd_commissioning.session import Commissioning, CommissionRecord
from robotd_tool_space import CollisionGuard

Install = Callable[..., Path]
Robotd = Callable[..., Result]

FENCE = """
    import threading
    from robotd.api.features import Feature, Section

    class FenceKeys(Section):
        fence: float | bool | None = None

    class Fence:
        def __init__(self, robot):
            self.limit = robot.descriptor.settings(FenceKeys).fence
            if self.limit < 0.0:
                raise OSError(5, "no fence")
            if self.limit > 8.0:
                threading.Event().wait()
            robot.fences = [*getattr(robot, "fences", []), self]

    FEATURE = Feature(
        "a fence",
        settings=FenceKeys,
        open="plugin_acme:nothing",
        guards={"fence": "plugin_acme:Fence"},
    )
"""


def write(folder: Path, *keys: str) -> Path:
    path = folder / "robot.yaml"
    path.write_text("\n".join(["extends: cr3a", "name: arm", *keys, ""]), encoding="utf-8")
    return path


@pytest.fixture
def fence(install: Install, tmp_path: Path) -> Callable[[str], Path]:
    """``fence(value)``: file of a robot whose key is of an installed third party."""
    site = install("fence", FENCE, group="robotd.features")
    entries = site / "acme-1.2.dist-info" / "entry_points.txt"
    entries.write_text("[robotd.features]\nfence = plugin_acme:FEATURE\n", encoding="utf-8")
    return lambda value: write(tmp_path, f"fence: {value}")


def fences(robot: Robot) -> list[float]:
    return [fence.limit for fence in getattr(robot, "fences", [])]


@pytest.mark.parametrize(("value", "made"), [("0.0", [0.0]), ("null", []), ("false", [])])
def test_a_guard_of_a_third_party_is_made_once_with_each_robot(
    fence: Callable[[str], Path], value: str, made: list[float]
) -> None:
    path = fence(value)
    robot = build_robot(path, "sim")
    for key, target in requested_guards(robot.descriptor).items():
        assert key == "fence"
        robot.feature(getattr(sys.modules["plugin_acme"], target.partition(":")[2]))
    assert fences(robot) == made
    with open_robot(path, "sim", clock=SteppedClock()) as opened:
        assert fences(opened) == made


def test_a_robot_does_not_open_without_its_guard(fence: Callable[[str], Path]) -> None:
    reason = (
        r"robot.yaml:3: fence: without this guard the robot does not run: OSError: .* no fence "
        r"\(plugin_acme.py:12\) of acme 1.2"
    )
    with pytest.raises(DescriptorError, match=reason), open_robot(fence("-1.0"), "sim"):
        pass


def test_a_guard_that_hangs_is_named(
    fence: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robotd.guards.GUARD_LIMIT_S", 0.2)
    reason = r"robot.yaml:3: fence: .* plugin_acme:Fence of acme 1.2 is not done within 0.2 s"
    with pytest.raises(DescriptorError, match=reason):
        build_robot(fence("9.0"), "sim")


def test_a_guard_that_no_plugin_provides_is_named_with_the_plugin_that_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    path = write(tmp_path, "tool_space: {collisions: {}}")
    for module in [
        module for module in sys.modules if module.partition(".")[0] == "robotd_tool_space"
    ]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "robotd_tool_space", None)
    _loaded.cache_clear()
    request.addfinalizer(_loaded.cache_clear)
    reason = (
        r"robot.yaml:3: tool_space: unknown key; .*: feature .*tool_space.* cannot be imported: Mod"
    )
    with pytest.raises(DescriptorError, match=reason), open_robot(path, "sim"):
        pass


def test_check_finds_a_guard_that_cannot_be_made(robotd: Robotd, tmp_path: Path) -> None:
    path = write(tmp_path, "tool_space: {reduced_speed_input: key}")
    result = robotd("check", "--robot", str(path), "--backend", "sim")
    assert result.exit_code == ExitCode.CONFIGURATION
    assert "fail  guards tool_space.reduced_speed_input" in result.output
    assert f"{path}:3: tool_space.reduced_speed_input: without this guard" in result.output
    assert "unknown input 'key'" in result.output
    path = write(tmp_path, "tool_space: {collisions: {}}")
    result = robotd("check", "--robot", str(path), "--backend", "sim")
    assert "ok    guards tool_space.collisions" in result.output
    assert result.exit_code == ExitCode.OK


def test_a_key_that_a_program_does_not_use_is_named_once(tmp_path: Path) -> None:
    path = write(tmp_path, "page: 0", "tool_space: {velocity_m_s: 0.1}")
    with capture_logs() as lines:
        for _ in range(2):
            with open_robot(path, "sim", clock=SteppedClock()):
                pass
    unused = [line for line in lines if line.get("keys")]
    assert [(line["keys"], line["file"], line["log_level"]) for line in unused] == [
        (("page",), path, "warning")
    ]


def test_a_robot_has_one_object_of_each_class() -> None:
    robot = build_robot("cr3a", "sim")
    assert robot.feature(CollisionGuard) is robot.feature(CollisionGuard)
    assert robot.feature(CollisionGuard) is not build_robot("cr3a", "sim").feature(CollisionGuard)


def test_a_joint_is_commissioned_alone_without_the_guards_that_need_all(tmp_path: Path) -> None:
    path = write(tmp_path, "tool_space: {collisions: {}}")

    def commissioning() -> Commissioning:
        return Commissioning(
            lambda other: load_robot_descriptor(other or path),
            load_backend("canopen"),
            "joint2",
            CommissionRecord(path),
            lambda axis: pytest.fail("nothing is opened"),
        )

    reason = (
        "robot.yaml:3: tool_space.collisions: needs all joints, and joint2 is commissioned alone; "
        "to do without, give --set tool_space.collisions=null, and keep its path free"
    )
    with pytest.raises(DescriptorError, match=reason):
        commissioning()
    write(tmp_path)
    assert commissioning().open_steps
