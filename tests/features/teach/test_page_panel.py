"""Motion of the page's panel in stepped time: from where it was shown, and while it is held."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from tests.features.page.server.viewer import wait_until

from robotd import Robot, open_robot
from robotd.api.robots import SteppedClock, TrajectoryRequest
from robotd_page.control_commands import Access
from robotd_page.held_motion import JogEnd
from robotd_teach.hand_guiding import HandGuiding
from robotd_teach.page_guiding import Guide, HeldGuiding
from robotd_teach.page_panel import TeachPanel
from robotd_teach.page_preview import HeldPreview, PlayPreview, Preview
from robotd_teach.poses import Poses

FILE = "extends: cr3a\nname: arm\nposes: poses.yaml\n"


class Client:
    """Page that holds a button; the robot's time is stepped."""

    def __init__(self, robot: Robot, held: type[HeldPreview | HeldGuiding]) -> None:
        self.robot, self.ended = robot, list[JogEnd]()
        self.held = held(robot, "page 1", ThreadPoolExecutor(2), self.ended.append)

    def run_until_ended(self) -> str:
        def has_ended() -> bool:
            self.robot.step(5)
            return bool(self.ended)

        wait_until(has_ended)
        return self.ended[0].reason


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    (tmp_path / "robot.yaml").write_text(FILE, encoding="utf-8")
    with open_robot(tmp_path / "robot.yaml", "sim", clock=SteppedClock()) as robot:
        robot.feature(Poses).save("zero")
        move(robot, 0.5)
        yield robot


def move(robot: Robot, joint1: float) -> None:
    rows = [[joint1, 0.0, 0.0, 0.0, 0.0, 0.0]]
    request = TrajectoryRequest.from_rows(robot.joint_names, [1.0], rows)
    with robot.follower.follow(request) as goal:
        while goal.outcome is None:
            robot.step(10)


def beat(start: tuple[float, ...]) -> PlayPreview:
    return PlayPreview(type="play", hold=1, kind="pose", name="zero", speed=1.0, start=start)


def test_a_preview_is_the_way_from_where_the_arm_is(robot: Robot) -> None:
    question = Preview(type="preview", id=1, kind="pose", name="zero", speed=0.2)
    motion = question.run(Access(robot, None, lambda: False))
    assert motion["start"] == motion["rows"][0] == [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert motion["rows"][-1] == [0.0] * 6
    robot.step(100)
    assert robot.image.position[0] == pytest.approx(0.5, abs=1e-3)


def test_a_motion_begins_only_from_where_it_was_shown(robot: Robot) -> None:
    client = Client(robot, HeldPreview)
    client.held.beat(beat((0.4, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert "the arm has moved since this motion was shown" in client.run_until_ended()
    assert robot.image.position[0] == pytest.approx(0.5, abs=1e-3)


def test_a_motion_ends_when_no_heartbeat_comes(robot: Robot) -> None:
    client = Client(robot, HeldPreview)
    client.held.beat(beat((0.5, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert client.run_until_ended() == "heartbeats did not come"
    assert client.ended[0].is_silent
    assert robot.image.position[0] > 0.3


def test_guiding_ends_when_no_heartbeat_comes(robot: Robot) -> None:
    client = Client(robot, HeldGuiding)
    client.held.beat(Guide(type="guide", hold=1, group="", held=False))
    assert client.run_until_ended() == "its client has been silent for 0.5 s"
    assert not client.ended[0].is_silent  # so that no page begins it anew
    assert robot.feature(HandGuiding).reason


def test_the_state_has_what_is_in_the_files(robot: Robot, tmp_path: Path) -> None:
    panel = TeachPanel(robot)
    assert panel.describe() == {
        "groups": ["joints"],
        "folder": str(tmp_path / "programs"),
        "guides": True,
        "falls": False,
    }
    assert panel.state()["poses"]["poses"]["zero"]["problem"] == ""
    (tmp_path / "poses.yaml").write_text("poses: [1]\n", encoding="utf-8")
    assert "poses.yaml:1: poses" in panel.state()["poses"]["error"]
    robot.feature(HandGuiding)
    assert panel.state()["recording"] is None
