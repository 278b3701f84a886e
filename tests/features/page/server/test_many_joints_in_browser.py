"""A robot with 43 joints in 11 groups, and missing meshes, on the page of a phone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect
from tests.features.page.server.browser import (
    chromium,
    has_sideways_scrolling,
    needs_browser,
    open_page,
)
from tests.features.page.server.controlled_page import Served, serve, unlock

pytestmark = needs_browser

COUNT, GROUPS = 43, 11
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'
MESHES = ("package://gone/thigh.stl", "shin.dae", "foot.obj", "toe.stl")


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("centipede")
    with serve(folder, write_robot(folder)) as served:
        yield served


@pytest.fixture(scope="module")
def page(served: Served) -> Iterator[Page]:
    errors: list[str] = []
    with chromium() as browser:
        page = opened(browser, errors)
        unlock(page, served)
        yield page
    assert not errors


def opened(browser: Browser, errors: list[str]) -> Page:
    page = open_page(browser, errors)
    page.set_viewport_size({"width": 390, "height": 844})
    return page


def write_robot(folder: Path) -> Path:
    """Write a robot of legs: a chain of 4 joints for each group, the last ones of 3."""
    links, joints, groups = [], [], dict[str, dict[str, list[str]]]()
    for number in range(COUNT):
        group, place = f"left_front_leg_number_{number // 4}", number % 4
        mesh = f'<visual><geometry><mesh filename="{MESHES[place]}"/></geometry></visual>'
        links.append(f'<link name="link{number}">{mesh if number < 4 else ""}</link>')
        parent = "base" if place == 0 else f"link{number - 1}"
        joints.append(
            f'<joint name="{group}_joint_{place}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link{number}"/><origin xyz="0.{number // 4:02} 0 0.2"/>'
            f'<axis xyz="0 1 0"/>{LIMIT}</joint>'
        )
        groups.setdefault(group, {"joints": []})["joints"].append(f"{group}_joint_{place}")
    body = "".join(['<link name="base"/>', *links, *joints])
    (folder / "robot.urdf").write_text(f'<robot name="legs">{body}</robot>', encoding="utf-8")
    content = {
        "schema": 1, "name": "legs", "backend": "sim", "cycle": {"rate_hz": 100},
        "urdf": "robot.urdf", "groups": groups,
        "joints": [
            {"name": joint, "axis": axis, "lower_rad": -1.0, "upper_rad": 1.0}
            | {"velocity_rad_s": 2.0, "acceleration_rad_s2": 8.0}
            for axis, joint in enumerate(j for group in groups.values() for j in group["joints"])
        ],
    }  # fmt: skip
    file = folder / "robot.yaml"
    file.write_text(json.dumps(content))
    return file


def test_a_robot_with_many_joints_begins_with_its_groups_folded(page: Page) -> None:
    expect(page.locator("#axes .fold")).to_have_count(GROUPS)
    expect(page.locator("#axes .fold .lamp")).to_have_text(["on"] * GROUPS)
    expect(page.locator("#axes tbody[data-axis]:visible")).to_have_count(0)
    expect(page.locator("#jog-rows [data-joint]:visible")).to_have_count(0)
    assert not has_sideways_scrolling(page)


def test_a_group_is_unfolded_by_its_name_and_by_a_fault(page: Page, served: Served) -> None:
    page.locator("#axes .fold").first.click()
    expect(page.locator("#axes tbody[data-axis]:visible")).to_have_count(4)
    page.locator("#jog-rows .fold").last.click()
    expect(page.locator("#jog-rows [data-joint]:visible")).to_have_count(COUNT % 4)
    assert not has_sideways_scrolling(page)
    served.robot.fault_injector.trip(41, 0x2310)
    expect(page.locator("#axes .fold").last.locator(".lamp")).to_have_text("fault")
    expect(page.locator("tbody[data-axis=left_front_leg_number_10_joint_1]")).to_be_visible()
    assert not has_sideways_scrolling(page)


def test_the_poses_of_the_tools_do_not_cover_the_robot(page: Page) -> None:
    tools, canvas = page.locator("#tools"), page.locator("#canvas")
    expect(tools.locator("li")).to_have_count(GROUPS)
    boxes = [element.bounding_box() for element in (canvas, tools)]
    assert boxes[0] is not None
    assert boxes[1] is not None
    assert boxes[0]["y"] + boxes[0]["height"] <= boxes[1]["y"]
    assert boxes[1]["height"] < boxes[0]["height"]


def test_capsules_stand_for_meshes_that_are_missing(page: Page) -> None:
    expect(page.locator("#mesh-note")).to_have_text(
        "4 meshes are missing or not STL, DAE or glTF, capsules are shown instead:"
        " thigh.stl, shin.dae, foot.obj, …"
    )
