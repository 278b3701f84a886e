"""Objects of a simulated world, in a real browser: drawn where they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page
from tests.features.page.server.browser import chromium, needs_browser, open_page
from tests.features.page.server.drawn_arm import picture, pixels
from tests.features.page.server.viewer import wait_until
from tests.world_backend import START, cube_backend

from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor
from robotd.robot import Robot
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import PageServer
from robotd_recorder.recorder import observed

pytestmark = needs_browser


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[tuple[Robot, Page]]:
    robot = Robot(load_robot_descriptor("cr3a"), cube_backend(), PacedClock(1.0))
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


def is_red(page: Page, position: np.ndarray) -> bool:
    """Return whether the pixel at a position of the robot's base has the colour of the cube."""
    drawn = picture(page)
    ((column, row),) = pixels(page, position[None], drawn.shape).round().astype(int)
    red, green, blue = drawn[row, column]
    return bool(red > 100 and max(green, blue) < red / 2)


def test_an_object_is_drawn_where_it_is_and_moves(robot: tuple[Robot, Page]) -> None:
    made, page = robot
    assert made.world is not None
    before, after = np.array(START[:3]), np.array([0.3, -0.2, 0.3])
    wait_until(lambda: is_red(page, before))
    assert not is_red(page, after)
    made.world.place("cube", np.array([*after, *START[3:]]))
    wait_until(lambda: is_red(page, after))
    assert not is_red(page, before)
