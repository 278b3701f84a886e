"""Cameras of a simulated world, in a real browser: pictures come while they are seen."""

from __future__ import annotations

import io
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page
from tests.features.page.server.browser import (
    chromium,
    keep_screenshot,
    needs_browser,
    open_page,
)
from tests.features.page.server.viewer import wait_until

from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor
from robotd.errors import OperationError
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_page.page_feed import RobotSource
from robotd_page.page_server import PageServer
from robotd_recorder.recorder import observed

NAMES = ["cell_camera", "wrist_camera"]


@dataclass
class CountingSource(RobotSource):
    """Source that counts the pictures it was asked for.

    Attributes:
        asked: names of the cameras.
        fails: no picture can be made.
    """

    asked: list[str] = field(default_factory=list)
    fails: bool = False

    def picture(self, camera: str) -> bytes:
        self.asked.append(camera)
        if self.fails:
            raise OperationError("no OpenGL for pictures")
        return super().picture(camera)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[Robot, CountingSource, str]]:
    robot = Robot(load_robot_descriptor("cr3a"), load_backend("mujoco"), PacedClock(1.0))
    with observed(robot, flight_folder=tmp_path) as recorder:
        source = CountingSource()
        RobotSource.__init__(source, recorder.tap, [])
        with PageServer(source, 0) as server:
            robot.start()
            yield robot, source, server.url
        robot.shutdown()


@pytest.fixture
def page(served: tuple[Robot, CountingSource, str]) -> Iterator[Page]:
    errors: list[str] = []
    with chromium(draws=False) as browser:
        page = open_page(browser, errors)
        page.goto(served[2])
        page.locator("body[data-connected=yes]").wait_for()
        yield page


def get(url: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(url, timeout=20) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_a_picture_is_the_one_of_the_camera(served: tuple[Robot, CountingSource, str]) -> None:
    robot, source, url = served
    assert robot.world is not None
    status, body = get(f"{url}camera/cell_camera")
    assert status == 200
    shown = np.asarray(Image.open(io.BytesIO(body))).astype(int)
    assert np.abs(shown - robot.world.image("cell_camera")).mean() < 4.0
    assert get(f"{url}camera/door")[0] == 404
    source.fails = True
    assert get(f"{url}camera/cell_camera") == (503, b"robotd: no OpenGL for pictures\n")


@needs_browser
def test_pictures_are_shown_and_follow_the_world(
    served: tuple[Robot, CountingSource, str], page: Page
) -> None:
    robot, source, _ = served
    images = page.locator("#camera-list img")
    assert [images.nth(place).get_attribute("alt") for place in range(2)] == [
        f"Picture of {name}" for name in NAMES
    ]
    page.locator("#cameras-title").scroll_into_view_if_needed()
    wait_until(lambda: source.asked.count("cell_camera") > 2)
    before = red_pixels(page)
    assert before > 20  # the cube
    keep_screenshot(page, "cameras", full_page=False)
    assert robot.world is not None
    robot.world.place("cube", np.array([0.3, 5.0, 0.02, 0.0, 0.0, 0.0, 1.0]))
    wait_until(lambda: red_pixels(page) == 0)


@needs_browser
def test_nothing_is_rendered_while_nobody_looks(
    served: tuple[Robot, CountingSource, str], page: Page
) -> None:
    _, source, _ = served
    page.locator("#cameras-title").scroll_into_view_if_needed()
    wait_until(lambda: len(source.asked) > 2)
    page.locator("#node-list").evaluate("element => element.style.marginTop = '3000px'")
    page.locator("#nodes-title").scroll_into_view_if_needed()
    # A picture that was asked for before still comes; after it there is none for ten periods.
    wait_until(lambda: settled(page, source))


def red_pixels(page: Page) -> int:
    """Return the number of pixels with the colour of the cube in the first picture."""
    return int(
        page.locator("#camera-list img").first.evaluate(
            """image => {
                const canvas = document.createElement("canvas");
                [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
                const drawing = canvas.getContext("2d");
                drawing.drawImage(image, 0, 0);
                const { data } = drawing.getImageData(0, 0, canvas.width, canvas.height);
                let red = 0;
                for (let at = 0; at < data.length; at += 4)
                    if (data[at] > 2 * data[at + 1] && data[at] > 2 * data[at + 2]) red += 1;
                return red;
            }"""
        )
    )


def settled(page: Page, source: CountingSource) -> bool:
    """Return True when a second passes without a request."""
    before = len(source.asked)
    page.wait_for_timeout(1000)
    return len(source.asked) == before
