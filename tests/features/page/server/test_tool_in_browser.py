"""The tool on the page, in a real browser: its pad."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect
from tests.features.page.server.browser import (
    PHONE,
    chromium,
    has_sideways_scrolling,
    needs_browser,
)
from tests.features.page.server.controlled_page import (
    Served,
    light_page,
    says,
    serve,
    unlock,
)
from tests.features.page.server.viewer import TIMEOUT_S, wait_until

from robotd.api import FloatArray
from robotd.motion import TrajectoryRequest

BENT = [0.3, -0.6, 1.6, -0.3, 1.2, 0.0]
pytestmark = needs_browser


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serve(tmp_path_factory.mktemp("page")) as served:
        bend(served)
        yield served


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


def bend(served: Served) -> None:
    """Move the arm away from its singular zero position."""
    request = TrajectoryRequest.from_rows(served.robot.joint_names, [1.0], [BENT])
    with served.robot.follower.follow(request) as goal:
        assert goal.wait(TIMEOUT_S)


def tool_position(served: Served) -> FloatArray:
    pose = served.robot.attribute("tool").measured_pose()
    assert pose is not None
    position: FloatArray = pose[:3, 3]
    return position


@pytest.fixture
def page(served: Served, browser: Browser) -> Iterator[Page]:
    page = light_page(browser, [])
    unlock(page, served)
    yield page
    page.close()


def hold(page: Page, direction: str) -> None:
    page.get_by_label(f"tool {direction}", exact=True).hover()
    page.mouse.down()


def test_the_tool_moves_along_its_axis_while_a_button_is_held(served: Served, page: Page) -> None:
    before = tool_position(served)
    hold(page, "z minus")
    wait_until(lambda: tool_position(served)[2] < before[2] - 0.01)
    says(page, "tool z: moving while held")
    page.mouse.up()
    says(page, "Jog: released")
    served.wait_until_free(1)
    moved = tool_position(served) - before
    assert np.abs(moved[:2]).max() < 1e-3
    page.get_by_role("button", name="Tool", exact=True).click()
    hold(page, "x plus")
    wait_until(lambda: np.linalg.norm(tool_position(served) - before - moved) > 5e-3)
    page.evaluate("dispatchEvent(new Event('blur'))")
    says(page, "Jog stopped: window lost focus")
    served.wait_until_free(1)
    page.mouse.up()


def test_a_tool_that_cannot_move_says_why(served: Served, page: Page) -> None:
    served.robot.axes.stop_latch.engage("by the panel")
    blocked = page.locator("#tool-blocked")
    expect(blocked).to_contain_text("The tool cannot be moved: motion is stopped: by the panel")
    hold(page, "z plus")
    says(page, "tool z: motion is stopped: by the panel")
    page.mouse.up()
    served.robot.reset()
    expect(blocked).to_be_hidden()
    page.set_viewport_size(PHONE)
    assert not has_sideways_scrolling(page)
