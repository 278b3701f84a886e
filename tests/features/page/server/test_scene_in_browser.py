"""Bodies that an arm keeps away from, drawn in a real browser while they are there, and carried."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.features.page.server.browser import chromium, needs_browser, open_page
from tests.features.page.server.drawn_arm import picture, pixels
from tests.features.page.server.viewer import wait_until

from robotd import build_robot
from robotd.api import FloatArray
from robotd.clock.simulated import PacedClock
from robotd.robot import Robot
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import PageServer
from robotd_recorder.recorder import observed
from robotd_tool_space import ToolGroups
from robotd_tool_space.collision.scene import Scene
from robotd_tool_space.collision.scene_object import SceneObject
from robotd_tool_space.geometry.rotations import pose_of

pytestmark = needs_browser

BESIDE = np.array([0.45, -0.4, 0.3])  # of the arm, which is not drawn there


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[tuple[Robot, Page]]:
    file = tmp_path / "robot.yaml"
    file.write_text("extends: cr3a\nname: arm\ntool_space: {collisions: {}}\n", encoding="utf-8")
    robot = build_robot(file, "sim", clock=PacedClock(1.0))
    errors: list[str] = []
    with observed(robot, flight_folder=tmp_path) as recorder, chromium() as browser:
        with PageServer(RobotSource(recorder.tap, []), 0) as server:
            robot.start()
            page = open_page(browser, errors)
            page.goto(server.url)
            page.locator("body[data-connected=yes]").wait_for()
            yield robot, page
        robot.shutdown()
    assert not errors


def scene_of(robot: Robot) -> Scene:
    scene = robot.feature(ToolGroups).only.scene
    assert scene is not None
    return scene


def is_orange(page: Page, position: FloatArray) -> bool:
    """Return whether the pixel at a position of the robot's base has a shade of the solids."""
    drawn = picture(page)
    ((column, row),) = pixels(page, position[None], drawn.shape).round().astype(int)
    red, _, blue = map(int, drawn[row, column])
    return red > blue + 30


def ball(place: FloatArray) -> SceneObject:
    return SceneObject("ball", "sphere", (0.08,), pose_of(place.tolist()))


def test_the_scene_is_drawn_while_it_changes(robot: tuple[Robot, Page]) -> None:
    made, page = robot
    scene = scene_of(made)
    assert not is_orange(page, BESIDE)
    scene.add(ball(BESIDE))
    wait_until(lambda: is_orange(page, BESIDE))
    page.reload()  # a new viewer has it from the start
    page.locator("body[data-connected=yes]").wait_for()
    wait_until(lambda: is_orange(page, BESIDE))
    there = BESIDE + np.array([0.0, 0.0, 0.25])
    scene.move("ball", pose_of(there.tolist()))
    wait_until(lambda: is_orange(page, there))
    assert not is_orange(page, BESIDE)
    wall = SceneObject("wall", "plane", (), pose_of([0.9, 0.0, 0.0], [0.0, -np.pi / 2, 0.0]))
    scene.add(wall)
    page.locator("[data-solids='ball wall']").wait_for()
    scene.remove()
    wait_until(lambda: not is_orange(page, there))
    page.locator("[data-solids='']").wait_for(state="attached")
