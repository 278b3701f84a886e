"""Layout of the control panel in Chromium: every jog button can be pressed, every name be read."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page
from tests.features.page.server.browser import chromium, has_sideways_scrolling, needs_browser
from tests.features.page.server.controlled_page import Served, light_page, serve, unlock
from tests.features.page.server.viewer import wait_until

from robotd.events import Level

WIDTHS = (360, 390, 768, 820, 1000, 1024, 1280, 1440)
HEIGHT = 800
pytestmark = needs_browser

LEGS = [f"{end}_{side}" for end in ("front", "rear") for side in ("left", "right")]
HAND = [f"{finger}_{part}" for finger in ("thumb", "index", "middle") for part in (0, 1)]
ARM = [
    *(f"shoulder_{turn}" for turn in ("pitch", "roll", "yaw")),
    "elbow",
    *(f"wrist_{turn}" for turn in ("roll", "pitch", "yaw")),
    *(f"hand_{part}" for part in ("thumb_2", *HAND)),
]
LEG = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"]
JOINTS: dict[str, Sequence[str]] = {
    "arm": ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"],
    "hand": [f"left_hand_{part}_joint" for part in HAND],
    "quadruped": [f"{leg}_{part}" for leg in LEGS for part in ("abduction", "hip", "knee")],
    "humanoid": [
        *(f"{side}_{part}_joint" for side in ("left", "right") for part in (*LEG, *ARM)),
        *(f"waist_{turn}_joint" for turn in ("yaw", "roll", "pitch")),
    ],
}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium(draws=False) as browser:
        yield browser


@pytest.fixture(scope="module", params=JOINTS)
def served(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp(request.param)
    with serve(folder, write_robot(folder, request.param)) as served:
        yield served


@pytest.fixture(scope="module")
def opened(served: Served, browser: Browser) -> Iterator[Page]:
    errors: list[str] = []
    page = light_page(browser, errors)
    unlock(page, served)
    yield page
    page.close()
    assert not [error for error in errors if "WebGL" not in error]


@pytest.fixture(params=WIDTHS)
def page(opened: Page, request: pytest.FixtureRequest) -> Page:
    opened.set_viewport_size({"width": request.param, "height": HEIGHT})
    return opened


def write_robot(folder: Path, name: str) -> Path:
    """Write the file of a robot with the joints of ``JOINTS``; JSON is YAML."""
    joints = [
        {"name": joint, "axis": axis, "lower_rad": -3.0, "upper_rad": 3.0}
        | {"velocity_rad_s": 3.0, "acceleration_rad_s2": 12.0}
        for axis, joint in enumerate(JOINTS[name])
    ]
    content = {"schema": 1, "name": name, "backend": "sim", "cycle": {"rate_hz": 100}}
    file = folder / "robot.yaml"
    file.write_text(json.dumps({**content, "joints": joints}))
    return file


BUTTONS = """() => [...document.querySelectorAll("#jog-rows .jog-button")].map(button => {
  button.scrollIntoView({block: "center"});
  const {left, right, top, bottom} = button.getBoundingClientRect();
  const inset = 4, xs = [left + inset, (left + right) / 2, right - inset];
  const ys = [top + inset, (top + bottom) / 2, bottom - inset];
  const hits = xs.flatMap(x => ys.map(y => document.elementFromPoint(x, y)));
  return {
    joint: button.closest("[data-joint]").dataset.joint, label: button.ariaLabel,
    width: right - left, height: bottom - top, hit: hits.every(each => each === button),
  };
})"""

PLACE = """index => {
  const button = document.querySelectorAll("#jog-rows .jog-button")[index];
  button.scrollIntoView({block: "center"});
  const {left, right, top, bottom} = button.getBoundingClientRect();
  const height = document.querySelector("#control").offsetTop;
  return [(left + right) / 2, (top + bottom) / 2, height];
}"""

# The characters of each name that are within its row and covered by nothing.
NAMES = """rows => [...document.querySelectorAll(rows)].map(row => {
  row.scrollIntoView({block: "center"});
  const name = row.querySelector(".joint-name"), box = row.getBoundingClientRect();
  const isSeen = ({left, right, top, bottom}) => {
    const isInside = left >= box.left && right <= box.right && top >= box.top && bottom <= box.bottom;
    const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
    return isInside && name.contains(hit);
  };
  const texts = document.createTreeWalker(name, NodeFilter.SHOW_TEXT), range = document.createRange();
  let seen = "";
  while (texts.nextNode()) {
    for (let at = 0; at < texts.currentNode.length; at++) {
      range.setStart(texts.currentNode, at);
      range.setEnd(texts.currentNode, at + 1);
      if (isSeen(range.getBoundingClientRect())) seen += range.toString();
    }
  }
  return seen;
})"""  # noqa: E501


def test_each_jog_button_is_large_and_covered_by_nothing(served: Served, page: Page) -> None:
    buttons = page.evaluate(BUTTONS)
    assert len(buttons) == 2 * len(served.robot.joint_names)
    assert not [button["label"] for button in buttons if not button["hit"]]
    assert min(min(button["width"], button["height"]) for button in buttons) >= 40
    assert not has_sideways_scrolling(page)


@pytest.mark.parametrize("rows", ["#jog-rows [data-joint]", "#axes tbody"])
def test_the_whole_name_of_each_joint_is_read_in_its_row(
    served: Served, page: Page, rows: str
) -> None:
    assert page.evaluate(NAMES, rows) == [*served.robot.joint_names]


def test_a_press_at_the_place_of_each_button_jogs_its_joint(served: Served, page: Page) -> None:
    events, cursor = served.robot.events, served.robot.events.added
    expected, jogged, heights = [], [], set()
    told = False  # of a busy computer: the page says so above the buttons

    def look() -> int:
        nonlocal cursor, told
        new, cursor = events.since(cursor)
        told = told or any(message.level in (Level.WARNING, Level.ERROR) for message in new)
        if any("of the page rejected" in message.text for message in new):
            page.mouse.up()  # the page showed an old state, the computer is busy
            page.mouse.down()
        jogs = (event.data["args"] for event in new if event.subject == "jog")
        jogged.extend((joint, velocity > 0) for joint, velocity, *_ in jogs)
        return len(jogged)

    for index, button in enumerate(page.evaluate(BUTTONS)):
        x, y, height = page.evaluate(PLACE, index)
        expected.append((button["joint"], button["label"].endswith("plus")))
        heights.add(height)
        page.mouse.move(x, y)
        page.mouse.down()  # held until it moves: what is released before that need not begin
        wait_until(lambda: look() >= len(expected))  # each: the log holds the newest ones only
        page.mouse.up()
    assert jogged == expected
    assert len(heights) == 1 or told  # a press moves no button
