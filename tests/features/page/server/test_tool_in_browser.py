"""The tool on the page, in a real browser: its pad, and its target."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect
from tests.features.page.server.browser import (
    PHONE,
    chromium,
    has_sideways_scrolling,
    keep_screenshot,
    needs_browser,
    open_page,
)
from tests.features.page.server.controlled_page import (
    Served,
    light_page,
    says,
    serve,
    unlock,
)
from tests.features.page.server.drawn_arm import pixels
from tests.features.page.server.viewer import TIMEOUT_S, wait_until

from robotd.api import FloatArray
from robotd.motion import TrajectoryRequest
from robotd_tool_space import ToolGroups

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
    pose = served.robot.feature(ToolGroups).only.measured_pose()
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


def drag_target(page: Page, place: FloatArray, right: float, down: float) -> None:
    """Drag the middle of the handles, which are at a place of the base, by pixels."""
    box = page.locator("#canvas").bounding_box()
    assert box is not None
    ((column, row),) = pixels(page, place[None], (round(box["height"]), round(box["width"])))
    x, y = box["x"] + column, box["y"] + row
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right, y + down, steps=3)
    page.mouse.up()


def test_a_target_is_shown_before_the_tool_moves_there(served: Served, browser: Browser) -> None:
    bend(served)
    page = open_page(browser, [])
    page.set_viewport_size(PHONE)  # small pictures are drawn quickly
    unlock(page, served)
    before, text, move = tool_position(served), page.locator("#target-text"), "#target-move"
    page.locator("#target-on").click()
    expect(text).to_contain_text("Reachable")
    drag_target(page, before, 0.0, 30.0)
    expect(page.locator(move)).to_have_attribute("aria-disabled", "false")
    assert tool_position(served) == pytest.approx(before, abs=1e-4)  # nothing has moved

    def is_moved() -> bool:
        if not page.locator(f"{move}.held").count():  # a page that draws slowly may stall
            page.locator(move).click()
        return bool(tool_position(served)[2] < before[2] - 0.02)

    wait_until(is_moved)
    page.evaluate("dispatchEvent(new Event('blur'))")
    wait_until(lambda: not served.robot.groups.of(["joint1"]).motion.moving)

    def is_out_of_reach() -> bool:
        page.locator("#target-back").click()  # the handles follow when the answer has come
        drag_target(page, tool_position(served), 120.0, -100.0)
        with suppress(AssertionError):
            expect(text).to_contain_text("Not reachable: ", timeout=2000.0)
            return True
        return False

    wait_until(is_out_of_reach)
    expect(page.locator("#target-line")).to_have_attribute("aria-disabled", "true")
    assert not has_sideways_scrolling(page)
    page.close()


def test_the_picture_of_the_documentation(served: Served, browser: Browser) -> None:
    bend(served)
    page = open_page(browser, [])
    unlock(page, served)
    page.set_viewport_size({"width": 1280, "height": 1180})
    page.locator("#target-on").click()
    expect(page.locator("#target-text")).to_contain_text("Reachable")
    drag_target(page, tool_position(served), -10.0, 60.0)
    expect(page.locator("#target-move")).to_have_attribute("aria-disabled", "false")
    page.mouse.move(5.0, 5.0)
    keep_screenshot(page, "page-tool", full_page=False)
    page.close()
