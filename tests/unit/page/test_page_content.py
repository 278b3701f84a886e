"""Samples, states and meshes of a page, without its server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.unit.observation.harness import Observed

from robotd.control.problem import ProblemKind
from robotd.events import sent_by
from robotd.page.live_samples import HEADER, LiveSamples
from robotd.page.mesh_files import mesh_files
from robotd.page.page_description import describe
from robotd.page.page_state import Goals, state_of

AXES = 6
VALUES = len(HEADER) + 1  # one group


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Observed]:
    observed = Observed(tmp_path)
    yield observed
    observed.close()


def rows(data: bytes | None) -> np.ndarray:
    assert data is not None
    return np.frombuffer(data).reshape(-1, VALUES + 5 * AXES)


def test_a_sample_has_the_values_of_the_newest_period(arm: Observed) -> None:
    live = LiveSamples(arm.tap)
    live.restart()
    assert live.sample() is None
    arm.step(0.1)
    (row,) = rows(live.sample())
    image = arm.robot.image
    assert row[0] == pytest.approx(arm.robot.control_loop.stats.last[0] * 1e-9)
    np.testing.assert_array_equal(row[VALUES:].reshape(5, AXES), image.values)
    assert row[2] == 0.0  # the gripper is open
    assert np.isnan(row[len(HEADER)])  # no goal
    assert live.sample() is None


def test_the_history_is_sampled_at_the_rate_of_the_page(arm: Observed) -> None:
    arm.step(2.0)
    history = rows(LiveSamples(arm.tap).history())
    step_s = np.diff(history[:, 0])
    assert 0.03 < np.median(step_s) < 0.04
    assert history[-1, 0] - history[0, 0] > 1.9
    np.testing.assert_array_equal(history[-1, VALUES + 12 : VALUES + 18], [0.0] * AXES)


def test_the_gripper_moves_in_the_samples(arm: Observed) -> None:
    live = LiveSamples(arm.tap)
    assert arm.robot.gripper is not None
    arm.robot.gripper.command(True)
    arm.step(0.1)
    assert rows(live.sample())[0, 2] == 1.0


def test_a_goal_has_its_sender_and_its_progress(arm: Observed) -> None:
    goals, live = Goals(arm.robot), LiveSamples(arm.tap)
    assert goals.running() == [None]
    with sent_by("/planner"), arm.goal([0.2] * AXES, 1.0) as execution:
        arm.step(0.4)
        for event in arm.tap.events.since(0)[0]:
            goals.note(event)
        (goal,) = goals.running()
        assert goal is not None
        assert (goal["sender"], goal["ending"]) == ("/planner", "")
        assert goal["duration_s"] == pytest.approx(1.0)
        assert rows(live.sample())[-1, len(HEADER)] == pytest.approx(0.4, abs=0.02)
        execution.cancel()
        arm.robot.step(5)
        (goal,) = goals.running()
        assert goal is not None
        assert goal["ending"] == "canceled by the client"
        arm.step(1.0)
    assert goals.running() == [None]


def test_problems_have_kinds_and_remedies(arm: Observed) -> None:
    def kinds() -> list[tuple[str, bool]]:
        state = state_of(arm.tap, [], 1)
        assert all(each["remedy"] for each in state["problems"])
        return [(each["kind"], each["is_fault"]) for each in state["problems"]]

    assert kinds() == []
    arm.robot.axes.servo(1, False)
    arm.step(0.1)
    assert kinds() == [(ProblemKind.SERVO_OFF, False)]
    arm.robot.fault_injector.disconnect(4)
    arm.robot.axes.stop_latch.engage("a guard is open")
    arm.step(0.3)
    found = kinds()
    assert found[0] == (ProblemKind.OFFLINE, True)
    assert found[-1] == (ProblemKind.STOPPED, False)
    state = state_of(arm.tap, [], 1)
    assert state["axes"][4]["offline"]
    assert "a guard is open" in state["problems"][-1]["text"]
    arm.step(1.0)  # the fieldbus is looked at once a second
    assert any(node["offline"] for node in state_of(arm.tap, [], 1)["buses"][0]["nodes"])


def test_inputs_are_shown_and_named(arm: Observed) -> None:
    arm.robot.fault_injector.set_input_bit(1, 3, True)
    arm.step(0.1)
    assert state_of(arm.tap, [], 1)["inputs"].startswith("0008")
    described = describe(arm.tap, ["a_node"], {}, 8)
    assert described["io_names"] == {"out0.0": "close gripper"}
    assert [each["name"] for each in described["fingers"]] == ["picker_1_joint", "picker_2_joint"]


def mesh(name: str) -> str:
    return f"<visual><geometry><mesh filename='{name}'/></geometry></visual>"


def test_only_meshes_of_the_urdf_are_found(tmp_path: Path) -> None:
    urdf = tmp_path / "acme_arm" / "urdf" / "arm.urdf"
    meshes = tmp_path / "acme_arm" / "meshes"
    urdf.parent.mkdir(parents=True)
    meshes.mkdir()
    for name in ("base.stl", "hand.STL", "passwords.txt"):
        (meshes / name).write_bytes(b"x")
    names = (
        "package://acme_arm/meshes/base.stl",
        "../meshes/hand.STL",
        "../meshes/passwords.txt",
        "../meshes/missing.stl",
        "http://example.com/x.stl",
    )
    text = f"<robot><link>{''.join(map(mesh, names))}</link></robot>"
    found = mesh_files(text, urdf)
    assert {name: path.resolve() for name, path in found.items()} == {
        "package://acme_arm/meshes/base.stl": meshes / "base.stl",
        "../meshes/hand.STL": meshes / "hand.STL",
    }
    assert mesh_files("", None) == {}
    assert mesh_files("no xml", urdf) == {}
