"""Teaching on the page, in a real browser: guiding, poses, paths and programs."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, expect
from tests.features.page.server.browser import (
    PHONE,
    SCREENSHOT,
    chromium,
    has_sideways_scrolling,
    keep_screenshot,
    needs_browser,
    open_page,
)
from tests.features.page.server.controlled_page import Served, light_page, says, serve, unlock
from tests.features.page.server.viewer import TIMEOUT_S, wait_until

from robotd.motion import TrajectoryRequest
from robotd_teach.hand_guiding import HandGuiding
from robotd_teach.poses import Poses
from robotd_teach.programs import Programs

BENT = [0.3, -0.6, 1.6, -0.3, 1.2, 0.0]
WIDTHS = (390, 820, 1440)
ROBOT = "extends: cr3a\nname: arm\nposes: poses.yaml\n"
CELL = """\
# the cell of the test
speed: 1.0
steps:
  # to the part
  - move: {joints: {joint1: 0.4}} # left
  - move: {joints: {joint1: -0.4}, speed: 0.01} # 20 s
  - message: done
"""
SEQUENCE = """\
  - sequence:
      segments:
        - line: {by: {z: 0.01}}
        - line: {by: {z: -0.01}}
      blend_m: 0.002
"""
pytestmark = needs_browser


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    (folder / "robot.yaml").write_text(ROBOT, encoding="utf-8")
    (folder / "programs").mkdir()
    return folder


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[Served]:
    with serve(folder, folder / "robot.yaml", teaches=True) as served:
        yield served


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def page(served: Served, browser: Browser) -> Iterator[Page]:
    bend(served)
    page = light_page(browser, [])
    unlock(page, served)
    yield page
    page.close()


def bend(served: Served, *rows: list[float]) -> None:
    """Lead the joints along positions, a second for each."""
    wait_until(lambda: not served.robot.groups.of(["joint1"]).motion.moving)
    times_s = [1.0 + index for index in range(max(len(rows), 1))]
    request = TrajectoryRequest.from_rows(served.robot.joint_names, times_s, [*(rows or [BENT])])
    with served.robot.follower.follow(request) as goal:
        assert goal.wait(TIMEOUT_S)


def position(served: Served, joint: int = 0) -> float:
    return float(served.robot.image.position[joint])


def taught(page: Page, kind: str, name: str) -> Locator:
    return page.locator(f"#{kind}-list > li", has=page.get_by_text(name, exact=True))


def enabled(page: Page, button: str) -> Locator:
    found = page.locator(button)
    expect(found).to_have_attribute("aria-disabled", "false")
    return found


def is_before(text: str, first: str, second: str) -> bool:
    return text.index(first) < text.index(second)


def write_cell(folder: Path, text: str = CELL, name: str = "cell") -> Path:
    file = folder / "programs" / f"{name}.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def choose(page: Page, name: str) -> None:
    expect(page.locator("#program-file option", has_text=name)).to_have_count(1)
    page.locator("#program-file").select_option(name)


def test_a_pose_is_saved_shown_gone_to_renamed_and_deleted(served: Served, page: Page) -> None:
    page.locator("#pose-name").fill("9 lives")
    page.locator("#pose-save").click()
    says(page, "'9 lives' is not a valid name of a pose")
    page.locator("#pose-name").fill("above")
    page.locator("#pose-save").click()
    expect(taught(page, "pose", "above")).to_contain_text("joint1 +0.300")
    bend(served, [0.0, *BENT[1:]])
    taught(page, "pose", "above").get_by_role("button", name="Show").click()
    go = enabled(page, "#preview-play")
    assert position(served) == pytest.approx(0.0, abs=1e-3)  # it is only shown
    go.click()  # the motion goes on after the button is released
    wait_until(lambda: abs(position(served) - 0.3) < 1e-3)
    says(page, "Move: reached")
    taught(page, "pose", "above").get_by_role("button", name="Rename").click()
    page.get_by_label("new name of above").fill("high")
    page.get_by_role("button", name="OK").click()
    expect(taught(page, "pose", "high")).to_be_visible()
    for text in ("Delete", "Delete?"):
        taught(page, "pose", "high").get_by_role("button", name=text, exact=True).click()
    expect(taught(page, "pose", "high")).to_have_count(0)
    assert not served.robot.feature(Poses).all()


def test_a_pose_beyond_the_limits_says_why_and_cannot_be_gone_to(
    served: Served, folder: Path, page: Page
) -> None:
    joints = {f"joint{index + 1}": 9.0 if index == 2 else 0.0 for index in range(6)}
    written = ", ".join(f"{joint}: {value}" for joint, value in joints.items())
    (folder / "poses.yaml").write_text(f"poses:\n  far: {{{written}}}\n", encoding="utf-8")
    expect(taught(page, "pose", "far")).to_contain_text("joint3 would be at 9 rad, its limits are")
    expect(taught(page, "pose", "far").get_by_role("button", name="Show")).to_be_disabled()
    (folder / "poses.yaml").unlink()


def test_motion_to_a_pose_ends_with_the_window(served: Served, page: Page) -> None:
    served.robot.feature(Poses).save("here", replace=True)
    bend(served, [2.0, *BENT[1:]])
    taught(page, "pose", "here").get_by_role("button", name="Show").click()
    enabled(page, "#preview-play").click()
    wait_until(lambda: position(served) < 1.9)
    page.evaluate("dispatchEvent(new Event('blur'))")
    says(page, "Move stopped: window lost focus")
    wait_until(lambda: not served.robot.groups.of(["joint1"]).motion.moving)
    assert position(served) > 0.5
    enabled(page, "#preview-play")
    place = position(served)
    served.robot.axes.stop_latch.engage("by the panel")
    expect(page.locator("#preview-play")).to_have_attribute(
        "title", re.compile("motion is stopped")
    )
    page.locator("#preview-play").click(force=True)  # it tells why
    says(page, "motion is stopped: by the panel")
    served.robot.reset()
    assert position(served) == pytest.approx(place, abs=1e-3)


def test_a_path_is_recorded_shown_with_the_way_to_it_and_played(
    served: Served, browser: Browser
) -> None:
    bend(served)
    page = open_page(browser, [])
    page.set_viewport_size(PHONE)  # small pictures are drawn quickly
    unlock(page, served)
    page.locator("#path-name").fill("wipe")
    page.locator("#path-record").click()
    expect(page.locator("#path-recording")).to_contain_text("wipe: ")
    bend(served, [0.6, *BENT[1:]], [0.9, *BENT[1:]])
    page.locator("#path-record").click()
    expect(taught(page, "path", "wipe")).to_contain_text("points")
    taught(page, "path", "wipe").get_by_role("button", name="Show").click()
    play = enabled(page, "#preview-play")
    expect(page.locator("#preview-text")).to_contain_text("first to its start: joint1 by -0.600")
    approach, path = map(int, (page.locator("#canvas").get_attribute("data-preview") or "").split())
    assert approach > 10
    assert path > 10
    page.locator("#preview-reverse").click()
    expect(page.locator("#preview-text")).to_contain_text("backwards")
    expect(page.locator("#canvas")).to_have_attribute("data-preview", "0 200")
    enabled(page, "#preview-play")
    assert position(served) == pytest.approx(0.9, abs=1e-3)

    def is_on_its_way() -> bool:
        if not page.locator("#preview-play.held").count():  # a page that draws slowly may stall
            play.click()
        return position(served) < 0.7

    wait_until(is_on_its_way)
    page.locator("#preview-stop").click()
    wait_until(lambda: not served.robot.groups.of(["joint1"]).motion.moving)
    assert position(served) > 0.31
    page.close()


def test_guiding_lasts_as_long_as_the_button_is_held(served: Served, page: Page) -> None:
    guiding = served.robot.feature(HandGuiding)

    def is_guided() -> bool:
        return "guiding" in served.robot.axes.owner(0)

    for end in ("release", "blur"):
        page.locator("#guide-on").hover()
        page.mouse.down()
        wait_until(is_guided)
        if end == "release":
            page.mouse.up()
            says(page, "Guiding: released")
        else:
            page.evaluate("dispatchEvent(new Event('blur'))")
            says(page, "Guiding stopped: window lost focus")
            page.mouse.up()
        wait_until(lambda: not is_guided())
        assert guiding.reason
    page.locator("#guide-on").hover()
    page.mouse.down()
    wait_until(is_guided)
    page.close()  # nothing arrives any more
    wait_until(lambda: not is_guided())


def test_a_program_is_checked_by_line_before_it_runs(
    served: Served, folder: Path, page: Page
) -> None:
    write_cell(folder, "steps:\n  - message: go\n  - move: {pose: nowhere}\n", "wrong")
    choose(page, "wrong")
    place = position(served)
    page.locator("#program-run").click()
    expect(page.locator("#program-problems")).to_contain_text("line 3: steps.1.move: unknown")
    expect(page.locator(".step.wrong")).to_contain_text("move: {pose: nowhere}")
    assert served.robot.feature(Programs).state.state == "none"
    assert position(served) == place
    write_cell(folder, "steps:\n  - mover: {pose: nowhere}\n", "wrong")
    expect(page.locator("#program-problems")).to_contain_text("line 2: steps.0.mover:")
    expect(page.locator("#program-run")).to_be_disabled()
    (folder / "programs" / "wrong.yaml").unlink()


def test_a_program_is_edited_and_keeps_its_comments(
    served: Served, folder: Path, page: Page
) -> None:
    file = write_cell(folder)
    choose(page, "cell")
    page.locator(".step", has_text="joint1: -0.4").click()
    page.locator("#program-steps").get_by_label("Speed, %").fill("25")
    page.locator("#program-steps").get_by_label("Speed, %").blur()
    wait_until(lambda: "speed: 0.25}" in file.read_text(encoding="utf-8"))
    expect(page.locator(".step", has_text="speed: 0.25")).to_be_visible()
    page.get_by_role("button", name="Up", exact=True).click()
    wait_until(lambda: is_before(file.read_text(encoding="utf-8"), "-0.4", "# to the part"))
    expect(page.locator(".step").first).to_contain_text("joint1: -0.4")
    page.get_by_role("button", name="Take present pose").click()
    wait_until(lambda: "joint1: 0.3000" in file.read_text(encoding="utf-8"))
    text = file.read_text(encoding="utf-8")
    assert all(comment in text for comment in ("# the cell of", "# to the part", "# left"))
    expect(page.locator(".step").first).to_contain_text("joint3: 1.6")
    file.write_text(text.replace("message: done", "message: edited"), encoding="utf-8")
    expect(page.locator(".step", has_text="message: edited")).to_be_visible()


def test_a_program_runs_is_paused_stepped_and_ends_with_its_page(
    served: Served, folder: Path, browser: Browser, page: Page
) -> None:
    programs = served.robot.feature(Programs)
    write_cell(folder)
    choose(page, "cell")
    page.locator("#program-step").click()
    expect(page.locator(".step.stopped")).to_contain_text("joint1: -0.4")  # the next one
    assert position(served) == pytest.approx(0.4, abs=1e-3)
    page.locator("#program-resume").click()
    expect(page.locator(".step.running")).to_contain_text("joint1: -0.4")
    page.locator("#program-pause").click()
    expect(page.locator("#program-state")).to_contain_text("paused: step 2 of 3")
    page.locator("#program-resume").click()
    expect(page.locator("#program-state")).to_contain_text("running: step 2 of 3")
    page.locator("#program-stop").click()
    expect(page.locator("#program-state")).to_contain_text("stopped at step 2 of 3")
    page.locator("#program-resume").click()
    expect(page.locator("#program-state")).to_contain_text("running: step 2 of 3")
    page.close()
    wait_until(lambda: programs.state.state == "stopped")
    assert "the page that ran the program has left" in programs.state.reason
    wait_until(lambda: not served.robot.groups.of(["joint1"]).motion.moving)
    assert position(served) > -0.39


def test_an_arm_that_falls_is_guided_only_while_it_is_said_to_be_held(
    folder: Path, browser: Browser
) -> None:
    with serve(folder, folder / "robot.yaml", teaches=True, falls=True) as served:
        page = light_page(browser, [])
        unlock(page, served)
        button, held = page.locator("#guide-on"), page.locator("#guide-held")
        expect(page.locator("#guide-falls")).to_be_visible()
        expect(button).to_be_disabled()
        held.check()
        expect(button).to_be_enabled()
        button.hover()
        page.mouse.down()
        wait_until(lambda: "guiding" in served.robot.axes.owner(0))
        page.mouse.up()
        wait_until(lambda: "guiding" not in served.robot.axes.owner(0))
        held.uncheck()
        expect(button).to_be_disabled()
        page.close()


def test_the_panel_fits_each_width(served: Served, folder: Path, browser: Browser) -> None:
    write_cell(folder, CELL + SEQUENCE)
    bend(served)
    served.robot.feature(Poses).save("above", replace=True)
    page = light_page(browser, [])
    unlock(page, served)
    choose(page, "cell")
    page.locator(".step").first.click()
    parts = ["10line: {by: {z: 0.01}}", "11line: {by: {z: -0.01}}"]
    expect(page.locator(".step.part")).to_have_text(parts)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert not has_sideways_scrolling(page)
        keep_screenshot(page, f"teach-{width}")
        expect(page.locator("#stop")).to_be_in_viewport()
        for button in page.locator("#teach button:visible").all():
            box = button.bounding_box()
            assert box is not None
            assert box["height"] >= 30
    page.close()


def test_the_picture_of_the_documentation(served: Served, folder: Path, browser: Browser) -> None:
    write_cell(folder)
    bend(served)
    served.robot.feature(Poses).save("above", replace=True)
    page = light_page(browser, [])
    unlock(page, served)
    page.set_viewport_size({"width": 1280, "height": 900})
    choose(page, "cell")
    write_cell(folder, CELL.replace("0.01} # 20 s", "0.2}"))
    expect(page.locator(".step", has_text="speed: 0.2}")).to_be_visible()
    page.locator("#program-step").click()
    expect(page.locator("#program-state")).to_contain_text("one step was executed")
    page.locator(".step.stopped").click()
    page.locator("#bar").evaluate("bar => { bar.style.visibility = 'hidden'; }")
    page.mouse.move(5.0, 5.0)
    page.locator("#program-none").evaluate(f"""line => {{
        const shown = line.cloneNode(true);
        shown.removeAttribute("id");
        shown.textContent = shown.textContent.replace("{folder}", "~/my_arm");
        line.after(shown);
        line.style.display = "none";
    }}""")  # the folder of the test says nothing to a reader
    expect(page.get_by_text("*.yaml in ~/my_arm/programs")).to_be_visible()
    SCREENSHOT.mkdir(parents=True, exist_ok=True)
    page.locator("#teach").screenshot(path=SCREENSHOT / "page-teach.png")
    page.close()
