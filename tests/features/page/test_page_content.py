"""Samples, states and meshes of a page, without its server."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.features.harness import Observed
from tests.world_backend import START, Cubes, cube_backend

from robotd.clock.simulated import SteppedClock
from robotd.control.groups.problem import ProblemKind
from robotd.descriptor import load_robot_descriptor
from robotd.events import EventKind, sent_by
from robotd.observation.frame_ring import frame_type
from robotd.robot import Robot
from robotd_page.live_samples import (
    HEADER,
    HISTORY_BYTES,
    HISTORY_COLUMNS,
    LiveSamples,
    PlotHistory,
)
from robotd_page.page_feed import PageFeed, WorldObjects, describe
from robotd_shared.mesh_files import MeshFiles, drawable_meshes
from robotd_shared.robot_state import Goals, state_of

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


def test_the_history_outlasts_the_frames_of_the_recorder(arm: Observed) -> None:
    live = LiveSamples(arm.tap)
    arm.step(12.0)
    assert arm.tap.frames.capacity == 2500  # 5 s
    history = rows(live.history())
    assert history[-1, 0] - history[0, 0] == pytest.approx(12.0, abs=0.2)
    assert np.diff(history[:, 0]).max() < 0.04  # without a gap


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


def test_each_viewer_gets_each_event_once(arm: Observed) -> None:
    feed = PageFeed(arm.tap, [], {})
    feed.first(1)
    got = []
    for viewers in (2, 3):
        arm.tap.events.add(EventKind.MARK, "test", f"before {viewers}")
        first = feed.first(viewers)
        arm.tap.events.add(EventKind.MARK, "test", f"after {viewers}")
        messages = [*first, *feed.messages(viewers, changes=True)]
        texts = [json.loads(message) for message in messages if isinstance(message, str)]
        events = [event for message in texts for event in message.get("events", ())]
        got = [event["text"] for event in events if event["subject"] == "test"]
    assert got == ["before 2", "after 2", "before 3", "after 3"]


def test_problems_have_kinds_and_remedies(arm: Observed) -> None:
    def kinds() -> list[tuple[str, bool]]:
        state = state_of(arm.tap, [], 1)
        assert all(problem["remedy"] for problem in state["problems"])
        return [(problem["kind"], problem["is_fault"]) for problem in state["problems"]]

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
    described = describe(arm.tap, ["a_node"], {})
    assert described["io_names"] == {"out0.0": "close gripper"}
    assert described["tools"] == [{"link": "link6", "base": "base_link"}]
    assert [finger["name"] for finger in described["fingers"]] == [
        "picker_1_joint",
        "picker_2_joint",
    ]


def test_axes_name_the_joints_of_the_urdf_that_they_move(tmp_path: Path) -> None:
    base = Observed(tmp_path, robot="baymax")
    axes = describe(base.tap, [], {})["axes"]
    base.close()
    assert [axis["joint"] for axis in axes] == ["left_wheel_joint", "right_wheel_joint"]


def test_the_latest_period_of_an_interval_is_kept_with_its_largest_lateness() -> None:
    history = PlotHistory(1, 90.0)
    assert history.step == 3
    frames = np.zeros(8, frame_type(1))
    frames["start_ns"] = np.arange(8) * 1_000_000_000
    frames["late_ns"] = [1000, 9000, 0, 0, 0, 2000, 4000, 0]
    frames["values"][:, 2, 0] = np.arange(8)
    for begin, end in ((0, 1), (1, 2), (2, 7), (7, 8)):  # whatever the pieces
        history.add(frames[begin:end])
    past = history.rows()
    np.testing.assert_array_equal(past[:, 0], [2.0, 5.0])
    np.testing.assert_allclose(past[:, 1], [9e-6, 2e-6])
    np.testing.assert_array_equal(past[:, HISTORY_COLUMNS + 2], [2.0, 5.0])
    history.add(frames[:1])
    assert history.rows()[2, 1] == pytest.approx(4e-6)


@pytest.mark.parametrize(("axes", "rate_hz"), [(6, 500.0), (128, 2000.0), (1, 10.0)])
def test_the_history_is_bounded_and_holds_a_minute(axes: int, rate_hz: float) -> None:
    history = PlotHistory(axes, rate_hz)
    assert history.nbytes <= HISTORY_BYTES
    assert history.nbytes / (8 * (HISTORY_COLUMNS + 5 * axes)) * history.step / rate_hz >= 59.0


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
    found = drawable_meshes(text, urdf)
    assert {name: path.resolve() for name, path in found.items()} == {
        "package://acme_arm/meshes/base.stl": meshes / "base.stl",
        "../meshes/hand.STL": meshes / "hand.STL",
    }
    assert drawable_meshes("", None) == {}
    assert drawable_meshes("no xml", urdf) == {}


def test_a_gltf_brings_the_files_beside_it_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "secret.bin").write_bytes(b"x")
    folder = tmp_path / "meshes"
    (folder / "textures").mkdir(parents=True)
    (folder / "the hand.bin").write_bytes(b"x")
    (folder / "textures" / "skin.png").write_bytes(b"x")
    (folder / "notes.txt").write_bytes(b"x")
    buffers = ["the%20hand.bin", "../secret.bin", "data:application/octet-stream;base64,eA=="]
    images = ["textures/skin.png", "notes.txt", "missing.png"]
    parts = {
        "buffers": [{"uri": uri} for uri in buffers],
        "images": [{"uri": uri} for uri in images],
    }
    (folder / "the hand.gltf").write_text(json.dumps(parts))
    (folder / "bad.gltf").write_text("[]")
    files = MeshFiles()
    text = f"<robot><link>{mesh('meshes/the hand.gltf')}{mesh('meshes/bad.gltf')}</link></robot>"
    urls = files.add(text, tmp_path / "arm.urdf")
    assert urls["meshes/the hand.gltf"] == "/mesh/0/the%20hand.gltf"
    assert files.file("/mesh/0/the hand.bin") == folder / "the hand.bin"
    assert files.file("/mesh/0/textures/skin.png") == folder / "textures" / "skin.png"
    for part in ("secret.bin", "../secret.bin", "notes.txt", "missing.png", ""):
        assert files.file(f"/mesh/0/{part}") is None


def test_objects_are_described_and_sent_again_when_they_have_moved(arm: Observed) -> None:
    assert WorldObjects(arm.robot).describe() is None
    assert WorldObjects(arm.robot).moved() is None
    robot = Robot(load_robot_descriptor("cr3a"), cube_backend(), SteppedClock())
    assert robot.world is not None
    objects = WorldObjects(robot)
    robot.start()
    described = json.loads(json.dumps(objects.describe()))
    assert described["frame"] == "base_link"
    (cube,) = described["shapes"]
    assert (cube["name"], cube["shape"], cube["size"]) == ("cube", "box", [0.04, 0.04, 0.04])
    assert described["poses"] == [[*START]]
    assert objects.moved() is not None
    assert objects.moved() is None  # it lies still
    robot.world.place("cube", np.array([0.3, *START[1:]]))
    moved = objects.moved()
    assert isinstance(moved, str)
    assert json.loads(moved) == {"type": "objects", "poses": [[0.3, *START[1:]]]}
    robot.shutdown()


def test_a_world_whose_poses_are_not_known_ends_no_feed(monkeypatch: pytest.MonkeyPatch) -> None:
    broken: list[bool] = []

    def poses(world: Cubes) -> np.ndarray:
        if broken:
            raise ValueError("the scene is gone")
        return np.array([START])

    monkeypatch.setattr(Cubes, "poses", poses)
    robot = Robot(load_robot_descriptor("cr3a"), cube_backend(), SteppedClock())
    robot.start()
    known, objects = WorldObjects(robot), WorldObjects(robot)
    assert known.moved() is not None
    broken.append(True)
    assert objects.describe() is None
    assert objects.moved() is None
    assert known.moved() is None
    described = known.describe()
    assert described is not None
    assert described["poses"] == [[*START]]
    robot.shutdown()
