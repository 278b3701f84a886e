"""The control side of the page in a real browser: it moves, stops, and shows each rejection."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, WebSocketRoute, expect
from tests.features.page.server.browser import (
    DESKTOP,
    PHONE,
    chromium,
    contrasts,
    has_sideways_scrolling,
    keep_screenshot,
    needs_browser,
    open_page,
)
from tests.features.page.server.controlled_page import (
    Served,
    light_page,
    press,
    says,
    serve,
    unlock,
)
from tests.features.page.server.viewer import TIMEOUT_S, wait_until

from robotd.motion import TrajectoryRequest
from robotd.motion.planar import ZERO_TWIST

LOST_FRAMES = 10**9
DRAWING_TIMEOUT_MS = 120_000  # of a page that draws by the processor while a joint moves
pytestmark = needs_browser


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serve(tmp_path_factory.mktemp("page")) as served:
        yield served


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def opened(served: Served, browser: Browser) -> Iterator[Page]:
    errors: list[str] = []
    page = light_page(browser, errors)
    unlock(page, served)
    expect(page.locator("#view-note")).to_contain_text("no WebGL")
    yield page
    page.close()
    assert not [error for error in errors if "WebGL" not in error]


@pytest.fixture(autouse=True)
def _may_move(served: Served) -> None:
    served.robot.reset()  # where the test before has failed


@pytest.fixture
def page(opened: Page) -> Page:
    opened.set_viewport_size(DESKTOP)
    opened.evaluate("scrollTo(0, 0)")
    return opened


def test_the_token_is_taken_out_of_the_address(served: Served, page: Page) -> None:
    expect(page).to_have_url(served.url)
    assert served.token not in page.content()


def test_a_joint_moves_while_its_button_is_held(served: Served, page: Page) -> None:
    press(page, "joint1")
    served.wait_until_moving()
    says(page, "joint1: moving while held")
    assert "page" in served.robot.axes.owner(0)
    page.mouse.up()
    says(page, "Jog: released")
    served.wait_until_free()
    position = served.robot.image.position[0]
    assert position > 0.0
    press(page, "joint1", "minus")
    wait_until(lambda: served.robot.image.position[0] < position - 0.01)
    page.mouse.up()
    says(page, "Jog: released")


def test_servos_go_off_while_values_are_stale(served: Served, page: Page) -> None:
    robot = served.robot
    button = page.get_by_role("button", name="Servos off", exact=True)
    robot.fault_injector.lose_packets(LOST_FRAMES)
    try:
        wait_until(lambda: not robot.connection.ready)
        expect(page.locator("#ready")).to_contain_text("fault")
        expect(button).to_be_enabled()
        button.click()
        says(page, "servo off was sent and is not confirmed")
    finally:
        robot.fault_injector.lose_packets(-LOST_FRAMES)  # the network is back
    wait_until(lambda: robot.connection.ready)
    assert not robot.image.servo_on[list(robot.joint_axes)].any()
    page.get_by_role("button", name="Servos on", exact=True).click()
    says(page, "servos are on")
    wait_until(lambda: all(robot.image.servo_on[axis] for axis in robot.joint_axes))


@pytest.mark.parametrize("key", ["Space", "Enter"])
def test_a_key_on_a_focused_button_holds_it(served: Served, page: Page, key: str) -> None:
    page.get_by_label("joint2 plus", exact=True).focus()
    page.keyboard.down(key)
    served.wait_until_moving(1)
    page.keyboard.up(key)
    says(page, "Jog: released")
    served.wait_until_free(1)


HIDE = """
Object.defineProperty(document, "hidden", {value: true, configurable: true});
document.dispatchEvent(new Event("visibilitychange"));
delete document.hidden;
"""


@pytest.mark.parametrize(
    ("event", "reason"),
    [
        ("dispatchEvent(new Event('blur'))", "window lost focus"),
        ("dispatchEvent(new Event('pagehide'))", "page left"),
        (HIDE, "tab hidden"),
    ],
)
def test_a_window_that_is_left_stops_the_joint(
    served: Served, page: Page, event: str, reason: str
) -> None:
    press(page, "joint1")
    served.wait_until_moving()
    page.evaluate(event)
    says(page, f"Jog stopped: {reason}")
    served.wait_until_free()
    page.mouse.up()


def test_a_page_that_has_stalled_stops_the_joint_and_does_not_go_on(
    served: Served, page: Page
) -> None:
    press(page, "joint1")
    served.wait_until_moving()
    page.evaluate("const end = performance.now() + 1500; while (performance.now() < end);")
    says(page, "Jog stopped: page stalled")
    served.wait_until_free()
    page.mouse.up()


def test_a_button_that_loses_the_focus_stops_the_joint(served: Served, page: Page) -> None:
    page.get_by_label("joint1 minus", exact=True).focus()
    page.keyboard.down("Space")
    served.wait_until_moving()
    page.keyboard.press("Tab")
    says(page, "Jog: released")
    served.wait_until_free()
    page.keyboard.up("Space")


def test_a_closed_tab_stops_the_joint(served: Served, browser: Browser) -> None:
    other = light_page(browser, [])
    unlock(other, served)
    press(other, "joint3")
    served.wait_until_moving(2)
    other.close()
    served.wait_until_free(2)


def test_a_step_moves_by_its_distance(served: Served, page: Page) -> None:
    before = served.robot.image.position_command[4]
    page.get_by_role("button", name="10°", exact=True).click()
    page.get_by_label("joint5 plus", exact=True).click()
    says(page, "Jog: reached")
    moved = served.robot.image.position_command[4] - before
    assert moved == pytest.approx(0.17453, abs=1e-4)
    page.get_by_role("button", name="Hold", exact=True).click()


def test_escape_stops_everything_and_a_rejected_jog_shows_the_reason(
    served: Served, page: Page
) -> None:
    press(page, "joint1")
    served.wait_until_moving()
    page.keyboard.press("Escape")
    page.mouse.up()
    says(page, "Stop: stopped, at rest")
    served.wait_until_free()
    assert served.robot.axes.stop_latch.reason == "by the stop button of the page"
    expect(page.locator("#jog-blocked")).to_have_text(
        "No joint can be jogged: motion is stopped: by the stop button of the page. Next: Reset."
    )
    expect(page.locator("#reset")).to_have_class("action next")
    expect(page.locator("#notices .press")).to_have_text("When it is safe to move: press Reset")
    expect(page.locator("#notices .command")).to_be_hidden()
    press(page, "joint1")
    says(page, "joint1: motion is stopped: by the stop button of the page")
    page.mouse.up()
    page.get_by_role("button", name="Reset", exact=True).click()
    says(page, "Reset: motion is allowed again")
    expect(page.locator("#jog-blocked")).to_be_hidden()
    press(page, "joint1")
    served.wait_until_moving()
    page.mouse.up()
    served.wait_until_free()


def test_the_late_end_of_a_jog_does_not_hide_the_answer_of_a_stop(
    served: Served, browser: Browser
) -> None:
    page, routes = light_page(browser, []), list[WebSocketRoute]()

    def tunnel(client: WebSocketRoute) -> None:
        client.connect_to_server()
        routes.append(client)

    page.route_web_socket(re.compile("/control$"), tunnel)
    unlock(page, served)
    press(page, "joint1")
    page.mouse.up()
    page.keyboard.press("Escape")
    says(page, "Stop: stopped, at rest")
    end = {"type": "jog", "hold": 1, "ok": True, "silent": False, "text": "released"}
    routes[0].send(json.dumps({**end, "remaining": None, "what": "Jog"}))
    page.evaluate("0")  # after the message
    assert page.locator("#answer").text_content() == "Stop: stopped, at rest"
    page.close()


def test_a_reset_held_up_on_its_way_does_not_undo_a_stop_that_came_meanwhile(
    served: Served, browser: Browser
) -> None:
    latch, page = served.robot.axes.stop_latch, light_page(browser, [])
    waiting: list[tuple[WebSocketRoute, str | bytes]] = []
    is_slow = True

    def tunnel(client: WebSocketRoute) -> None:
        server = client.connect_to_server()

        def carry(message: str | bytes) -> None:
            if is_slow and '"reset"' in str(message):
                waiting.append((server, message))
            else:
                server.send(message)

        client.on_message(carry)

    page.route_web_socket(re.compile("/control$"), tunnel)
    unlock(page, served)
    latch.engage("by the panel")
    expect(page.locator("#notices")).to_contain_text("motion is stopped: by the panel")
    reset = page.get_by_role("button", name="Reset", exact=True)
    reset.click()
    says(page, "Reset …")
    latch.engage("by another panel")
    for server, message in waiting:
        server.send(message)
    says(
        page, "Reset rejected: motion stopped again: by another panel, after what this page showed"
    )
    assert latch.reason == "by the panel"
    is_slow = False
    expect(page.locator("#events")).to_contain_text("motion stopped again")  # so it is shown now
    reset.click()
    says(page, "Reset: motion is allowed again")
    page.close()


def test_every_command_works_and_a_rejected_one_shows_its_reason(
    served: Served, page: Page
) -> None:
    robot = served.robot
    page.get_by_role("button", name="Close", exact=True).click()
    says(page, "Close gripper: gripper closes")
    assert robot.io.output_bit(0, 0)
    page.get_by_role("button", name="Open", exact=True).click()
    says(page, "gripper opens")
    page.locator("#output-byte").fill("2")
    page.locator("#output-value").fill("5")
    page.get_by_role("button", name="Set byte").click()
    says(page, "output byte 2 is 5")
    assert robot.io.output_bytes(2, 1) == b"\x05"
    page.locator("#output-bit").fill("3")
    page.get_by_role("button", name="On", exact=True).click()
    says(page, "output 2.3 is on")
    page.locator("#output-byte").fill("9999")
    page.get_by_role("button", name="Off", exact=True).click()
    says(page, "Output rejected: output bytes 9999..9999 are outside 0..")
    page.get_by_role("button", name="Servos off").click()
    says(page, "servos are off")
    expect(page.locator("#servos-on")).to_have_class("action next")
    press(page, "joint1")
    says(page, "joint1: servo is off")
    page.mouse.up()
    page.get_by_role("button", name="Servos on").click()
    says(page, "servos are on")
    expect(page.locator(".next")).to_have_count(0)
    assert robot.image.servo_on[:6].all()


def test_a_base_drives_while_its_button_is_held(tmp_path: Path, browser: Browser) -> None:
    with serve(tmp_path, "baymax") as served:
        base = served.robot.base
        assert base is not None
        page = light_page(browser, [])
        unlock(page, served)
        expect(page.locator("#jog")).to_be_hidden()  # it has wheels only
        expect(page.locator("#drive-hint")).to_contain_text("slow down within 75 ms")

        def drive(direction: str) -> None:
            page.get_by_role("button", name=direction, exact=True).hover()
            page.mouse.down()
            wait_until(lambda: base.limited != ZERO_TWIST)
            says(page, f"{direction}: moving while held")

        drive("Forward")
        wait_until(lambda: base.pose.x > 0.01)
        page.mouse.up()
        says(page, "Jog: released")
        wait_until(lambda: not base.moving)
        drive("Turn left")
        wait_until(lambda: base.pose.heading > 0.01)
        page.evaluate("dispatchEvent(new Event('blur'))")
        wait_until(lambda: not base.moving)
        page.mouse.up()
        drive("Back")
        page.close()
        wait_until(lambda: not base.moving)


def test_the_speed_can_be_set_and_motion_paused(served: Served, page: Page) -> None:
    slider = page.locator("#speed-slider")
    slider.fill("50")
    says(page, "Speed: speed 50 %")
    assert served.robot.axes.speed.speed == 0.5
    pause = page.locator("#pause")
    pause.click()
    expect(pause).to_have_attribute("aria-pressed", "true")
    press(page, "joint1")
    says(page, "motion is paused")
    page.mouse.up()
    pause.click()
    says(page, "Resume: speed 50 %")
    slider.fill("100")
    says(page, "speed 100 %")


def test_a_fault_is_injected_and_recovered_from(served: Served, page: Page) -> None:
    page.locator("#fault-kind").select_option("amp_alarm")
    page.locator("#fault-fields select").select_option("2")
    page.get_by_role("button", name="Inject").click()
    says(page, "injected: amp_alarm axis=2")
    expect(page.locator("#faults")).to_contain_text("joint3: amplifier alarm")
    press(page, "joint3")
    says(page, "joint3: amplifier alarm")
    page.mouse.up()
    page.get_by_role("button", name="Recover", exact=True).click()
    says(page, "verified: 6 axes on")
    bottom = "each => each.scrollTop + each.clientHeight - each.scrollHeight"
    assert page.locator("#answer").evaluate(bottom) > -2  # the last line is in sight
    expect(page.locator("#faults")).to_be_hidden()


def test_the_pictures_of_the_documentation(served: Served, browser: Browser) -> None:
    robot, page = served.robot, open_page(browser, [])
    positions = [0.5, -0.5, 1.0, -0.4, 0.8, 0.0]
    request = TrajectoryRequest.from_rows(robot.joint_names, [2.0], [positions])
    with robot.follower.follow(request) as goal:
        goal.wait(TIMEOUT_S)
    page.set_default_timeout(DRAWING_TIMEOUT_MS)
    unlock(page, served)
    page.set_viewport_size({"width": 1280, "height": 1010})
    press(page, "joint1")
    row, answer = page.locator("tbody[data-axis=joint1]"), page.locator("#answer")
    expect(row.locator(".state")).to_have_text("stream", timeout=DRAWING_TIMEOUT_MS)
    expect(row.locator(".owner")).to_have_text(re.compile(r"page \d+"), timeout=DRAWING_TIMEOUT_MS)
    keep_screenshot(page, "page-control", full_page=False)
    page.mouse.up()
    expect(answer).to_contain_text("Jog: released", timeout=DRAWING_TIMEOUT_MS)
    page.set_viewport_size(PHONE)
    page.locator("#control").evaluate("each => each.scrollIntoView()")
    keep_screenshot(page, "page-control-phone", full_page=False)
    page.close()


def test_the_stop_button_is_always_in_sight_and_a_phone_needs_no_sideways_scrolling(
    page: Page,
) -> None:
    for size in (DESKTOP, PHONE):
        page.set_viewport_size(size)
        assert not has_sideways_scrolling(page)
        for place in ("0", "document.body.scrollHeight / 2", "document.body.scrollHeight"):
            page.evaluate(f"scrollTo(0, {place})")
            expect(page.locator("#stop")).to_be_in_viewport(ratio=1)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_buttons_have_enough_contrast(page: Page, scheme: str) -> None:
    text = [("--stop-text", "--stop"), ("--text", "--button"), ("--good", "--panel")]
    assert min(contrasts(page, scheme, text)) >= 4.5
    lines = [("--button-line", "--panel"), ("--stop-line", "--panel")]
    assert min(contrasts(page, scheme, lines)) >= 3.0


def test_a_page_that_hears_nothing_says_that_it_is_old(served: Served, browser: Browser) -> None:
    """As behind a cable that was pulled: its connection is not closed."""
    page = light_page(browser, [])
    is_cut = False

    def tunnel(client: WebSocketRoute) -> None:
        client.connect_to_server().on_message(
            lambda message: None if is_cut else client.send(message)
        )

    page.route_web_socket(re.compile("/ws$"), tunnel)
    unlock(page, served)
    lost = page.locator("#lost")
    expect(lost).to_be_hidden()
    is_cut = True
    expect(lost).to_contain_text("Nothing has come from robotd for 5 s. What is shown is old.")
    is_cut = False
    expect(lost).to_be_hidden()
    page.close()


def test_without_the_token_the_page_only_reads(served: Served, browser: Browser) -> None:
    page = light_page(browser, [])
    page.goto(served.url)
    expect(page.locator("#unlock")).to_be_visible()
    expect(page.locator("#bar")).to_be_hidden()
    expect(page.locator("#control-body")).to_be_hidden()
    page.keyboard.press("Escape")
    page.locator("#token").fill("guessed")
    page.get_by_role("button", name="Unlock").click()
    expect(page.locator("#unlock-text")).to_contain_text("Rejected: wrong token")
    expect(page.locator("#bar")).to_be_hidden()
    assert served.robot.axes.stop_latch.reason == ""
    page.locator("#token").fill(served.address)
    page.get_by_role("button", name="Unlock").click()
    expect(page.locator("#bar")).to_be_visible()
    page.reload()
    expect(page.locator("#bar")).to_be_visible()
    page.close()
