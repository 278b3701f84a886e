"""The page in a real browser: the arm is drawn where its joints are, faults are shown."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from scipy.spatial.transform import Rotation
from tests.features.harness import Observed
from tests.features.page.server.browser import (
    DESKTOP,
    NO_WEBGL,
    PHONE,
    chromium,
    contrasts,
    has_sideways_scrolling,
    keep_screenshot,
    needs_browser,
    open_page,
)
from tests.features.page.server.drawn_arm import (
    NUMBER,
    differences,
    link_points,
    move,
    picture,
    pixels,
    shows,
)
from tests.features.page.server.viewer import served_page, silent_viewer, wait_until

from robotd.descriptor import load_robot_descriptor
from robotd.descriptor.urdf import read_urdf
from robotd.device.tool_pose import tool_poses
from robotd_page.page_server import PageServer

NODES = load_robot_descriptor("cr3a").nodes
POSE = [0.9, -0.9, 1.2, -0.4, 0.8, 0.0]
BENT = 25  # least difference of a pixel in front of the background, of 255
pytestmark = needs_browser


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Observed, PageServer]]:
    with served_page(tmp_path_factory.mktemp("page"), nodes=NODES) as pair:
        yield pair


@pytest.fixture(scope="module")
def opened(served: tuple[Observed, PageServer]) -> Iterator[Page]:
    """One page for all tests: to load it takes seconds where the processor draws."""
    errors: list[str] = []
    with chromium() as browser:
        page = open_page(browser, errors)
        page.goto(served[1].url)
        page.locator("body[data-connected=yes]").wait_for()
        yield page
    assert not errors  # of scripts, and violations of the policy


@pytest.fixture
def arm(served: tuple[Observed, PageServer]) -> Observed:
    return served[0]


@pytest.fixture
def page(opened: Page) -> Page:
    opened.set_viewport_size(DESKTOP)
    opened.locator("#view-reset").click()
    return opened


@pytest.mark.daily
def test_the_arm_is_drawn_where_its_joints_are(arm: Observed, page: Page) -> None:
    shows(page, 1, "+0.0000 rad")
    upright, points = picture(page), link_points(arm)
    move(arm, POSE)
    shows(page, 1, "+0.9000 rad")
    shows(page, 3, "+1.2000 rad")
    bent, bent_points = picture(page), link_points(arm)
    at_upright, at_bent = (pixels(page, cloud, bent.shape) for cloud in (points, bent_points))
    assert np.abs(at_upright - at_bent)[1:].max() > 30  # pixels: the poses differ clearly
    # Where the arm was there is background now, and the other way round.
    assert min(differences(upright, bent, at_upright[1:])) > BENT
    assert min(differences(upright, bent, at_bent[1:])) > BENT
    move(arm, [0.0] * 6)
    shows(page, 1, "+0.0000 rad")
    again = picture(page)
    assert np.abs(again - upright).mean() < 1.0


def test_the_pose_of_the_tool_is_shown(arm: Observed, page: Page) -> None:
    move(arm, POSE)
    shows(page, 1, "+0.9000 rad")
    urdf = arm.robot.descriptor.urdf
    assert urdf is not None
    positions = dict(zip(arm.robot.joint_names, POSE, strict=True))
    (tool,) = tool_poses(arm.robot.descriptor)
    frame = read_urdf(urdf).pose(tool.link, positions)
    roll, pitch, yaw = Rotation.from_matrix(frame[:3, :3]).as_euler("xyz")
    shown = page.locator("#tools li")
    expect(shown).to_contain_text(f"{tool.link} in {tool.base}")

    def numbers() -> list[float]:
        """Position in m and angles in rad, as they are shown."""
        return [
            float(number.replace("−", "-")) for number in re.findall(NUMBER, shown.inner_text())
        ]

    wait_until(lambda: numbers() == pytest.approx([*frame[:3, 3], roll, pitch, yaw], abs=2e-3))
    move(arm, [0.0] * 6)
    shows(page, 1, "+0.0000 rad")


def test_a_fault_turns_its_joint_red_and_names_cause_and_remedy(arm: Observed, page: Page) -> None:
    shows(page, 3, "on")
    before, points = picture(page), link_points(arm)
    arm.robot.fault_injector.trip(2, 0x8611)
    arm.step(0.2)
    banner = page.locator("#faults")
    expect(banner).to_be_visible()
    expect(banner).to_contain_text("joint3: amplifier alarm 34321 (following error)")
    expect(banner).to_contain_text("robotd recover")
    expect(page.locator("tbody.faulty")).to_have_count(1)
    shows(page, 3, "amplifier alarm 34321 (following error)")
    after = picture(page)
    column, row = pixels(page, points[1:2], after.shape)[0].round().astype(int)
    red, green, blue = after[row, column]
    assert red > 2 * max(green, blue), after[row, column]
    assert before[row, column].min() > 100  # it was grey
    assert page.title().startswith("FAULT joint3")
    keep_screenshot(page, "page-fault")
    arm.robot.recover()
    arm.step(0.2)
    expect(banner).to_be_hidden()
    expect(page.locator("tbody.faulty")).to_have_count(0)
    assert np.abs(picture(page) - before).mean() < 2.0


def test_a_joint_outside_its_limits_is_a_notice(arm: Observed, page: Page) -> None:
    axes = arm.robot.axes
    limits = axes.limits
    axes.limits = (*limits[:2], replace(limits[2], lower=0.5), *limits[3:])
    arm.step(0.1)
    expect(page.locator("#ready")).to_have_text("ready, a joint is outside its limits")
    notice = page.get_by_text("joint3: at 0 rad, outside its limits 0.5 to 2.86 rad")
    expect(notice.first).to_be_visible()
    expect(page.get_by_text("Jog it back inside, or correct its").first).to_be_visible()
    axes.limits = limits
    arm.step(0.1)
    expect(page.locator("#ready")).to_have_text("ready")


def test_the_page_shows_everything_else(arm: Observed, page: Page) -> None:
    expect(page.locator("#simulated")).to_be_visible()
    expect(page.locator("#ready")).to_have_text("ready")
    expect(page.locator("#nodes li")).to_have_text([*NODES])
    expect(page.locator("#buses")).to_contain_text("operational")
    gripper = page.locator("#io-named li", has_text="close gripper").locator(".bit")
    expect(gripper).to_have_attribute("aria-label", "output 0.0 off")
    arm.robot.io.set_output_bit(0, 0, True)
    arm.step(0.1)
    expect(gripper).to_have_attribute("aria-label", "output 0.0 on")
    arm.robot.io.set_output_bit(0, 0, False)
    expect(page.locator("#plot-list figure")).to_have_count(4)
    for sign in (1, -1, 1, -1):
        move(arm, [sign * 0.4, -0.3, 0.7 + 0.3 * sign, 0.2 * sign, 0.6, 0.5 * sign])
    with arm.goal([0.1, -0.5, 0.8, 0.2, 0.6, 0.0], 3.0):
        arm.step(1.5)
        expect(page.locator("#goals")).to_contain_text("over 3.0 s")
        keep_screenshot(page, "page")
        arm.step(2.0)
    expect(page.locator("#events")).to_contain_text("goal succeeded")
    move(arm, [0.0] * 6)


def test_the_page_works_by_keyboard(arm: Observed, page: Page) -> None:
    page.locator("#robot").click()
    page.keyboard.press("Tab")
    expect(page.locator("#view-reset, #canvas").first).to_be_focused()
    canvas = page.locator("#canvas")
    before = canvas.get_attribute("data-projection")
    canvas.press("ArrowLeft")
    expect(canvas).not_to_have_attribute("data-projection", before or "")
    freeze = page.locator("#freeze")
    freeze.focus()
    page.keyboard.press("Enter")
    expect(freeze).to_have_attribute("aria-pressed", "true")
    page.locator("#degrees").press("Space")
    arm.step(0.1)
    shows(page, 1, "0.00 °")
    page.locator("#degrees").press("Space")
    freeze.press("Enter")
    expect(freeze).to_have_attribute("aria-pressed", "false")


def shown_seconds(page: Page) -> list[list[float]]:
    """First and last second of each plot."""
    figures = page.locator("#plot-list figure").all()
    return [
        [*map(float, (figure.get_attribute("data-seconds") or "").split())] for figure in figures
    ]


def test_a_drag_zooms_all_plots_and_a_double_click_shows_the_minute_again(page: Page) -> None:
    freeze, minute = page.locator("#freeze"), [[-60.0, 0.0]] * 4
    expect(page.locator("#plot-list figure[data-seconds]")).to_have_count(4)
    area = page.locator("#plot-list .u-over").first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    assert box is not None
    assert shown_seconds(page) == minute
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.25 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], middle, steps=5)
    page.mouse.up()
    expect(freeze).to_have_attribute("aria-pressed", "true")
    assert np.allclose(shown_seconds(page), [[-45.0, -15.0]] * 4, atol=1.0)
    area.dblclick()
    expect(freeze).to_have_attribute("aria-pressed", "false")
    assert shown_seconds(page) == minute


def test_a_phone_needs_no_sideways_scrolling(page: Page) -> None:
    page.set_viewport_size(PHONE)
    assert not has_sideways_scrolling(page)
    keep_screenshot(page, "page-phone")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_enough_contrast(page: Page, scheme: str) -> None:
    pairs = [
        ("--text", "--back"),
        ("--text", "--panel"),
        ("--muted", "--panel"),
        ("--muted", "--back"),
        ("--good", "--good-back"),
        ("--warn", "--warn-back"),
        ("--bad", "--bad-back"),
        ("--bad", "--panel"),
        ("--accent", "--panel"),
    ]
    assert min(contrasts(page, scheme, pairs)) >= 4.5


def test_five_tabs_show_the_same_beside_one_that_does_not_read(
    opened: Page, tmp_path: Path
) -> None:
    browser = opened.context.browser
    assert browser is not None
    with served_page(tmp_path, heartbeat_s=2.0) as (arm, server):
        tabs = [open_page(browser, []) for _ in range(5)]
        for tab in tabs:
            tab.add_init_script(NO_WEBGL)
            tab.goto(server.url)
        for tab in tabs:
            expect(tab.locator("#viewers")).to_have_text("5 viewers")
        with silent_viewer(server.url):
            expect(tabs[0].locator("#viewers")).to_have_text("6 viewers")
            expect(tabs[0].locator("#viewers")).to_have_text("5 viewers")
            move(arm, POSE)
            for tab in tabs:
                shows(tab, 1, "+0.9000 rad")
                shows(tab, 3, "+1.2000 rad")
        expect(tabs[0].locator("#view-note")).to_contain_text("has no WebGL")
        for tab in tabs:
            tab.close()


ROBOT = """
schema: 1
name: acme
urdf: acme.urdf
joints:
  - {name: joint1, axis: 0, lower_rad: -2.0, upper_rad: 2.0, velocity_rad_s: 2.0,
     acceleration_rad_s2: 8.0}
"""
URDF = """<robot name="acme">
  <link name="base"/>
  <joint name="joint1" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="2" effort="1"/>
  </joint>
  <link name="arm">{visual}</link>
  <joint name="flange" type="fixed">
    <parent link="arm"/><child link="tool"/><origin xyz="0 0 0.6"/>
  </joint>
  <link name="tool"/>
</robot>
"""
STL = """<visual>
  <geometry><mesh filename="package://acme/meshes/arm.stl" scale="0.001 0.001 0.001"/></geometry>
</visual>"""
GLTF = """<visual>
  <geometry><mesh filename="package://acme/meshes/arm.gltf"/></geometry>
</visual>"""

COLLADA = """<visual>
  <geometry><mesh filename="package://acme/meshes/arm.dae"/></geometry>
</visual>"""
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
  <library_effects><effect id="paint"><profile_COMMON><technique sid="common"><lambert>
    <diffuse><color>0 0.6 0 1</color></diffuse>
    <transparent opaque="A_ONE"><color>1 1 1 1</color></transparent>
    <transparency><float>0</float></transparency>
  </lambert></technique></profile_COMMON></effect></library_effects>
  <library_materials><material id="green"><instance_effect url="#paint"/></material>
  </library_materials>
  <library_geometries><geometry id="box"><mesh>
    <source id="corners"><float_array id="numbers" count="24">{numbers}</float_array>
      <technique_common><accessor source="#numbers" count="8" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="points"><input semantic="POSITION" source="#corners"/></vertices>
    <triangles count="12" material="paint"><input semantic="VERTEX" source="#points" offset="0"/>
      <p>{indices}</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene"><node><instance_geometry url="#box">
    <bind_material><technique_common><instance_material symbol="paint" target="#green"/>
    </technique_common></bind_material></instance_geometry></node></visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""


def box(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Corners (8, 3) and triangles (12, 3) of a box that stands on the origin."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    faces = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4)]
    faces += [(2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]
    return corners * size, np.array(faces)


def write_stl(path: Path, size: tuple[float, float, float]) -> None:
    """Write a box as a binary STL."""
    corners, faces = box(size)
    triangles = np.zeros(len(faces), [("corners", "<f4", (4, 3)), ("attribute", "<u2")])
    triangles["corners"][:, 1:] = corners[faces]
    path.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + triangles.tobytes())


def write_gltf(path: Path, size: tuple[float, float, float], color: list[float]) -> None:
    """Write a box as a glTF with a file of its own for the numbers."""
    corners, faces = box(size)
    positions, indices = corners.astype("<f4").tobytes(), faces.astype("<u2").tobytes()
    path.with_suffix(".bin").write_bytes(positions + indices)
    material = {"pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0.0}}
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{**material, "doubleSided": True}],
        "buffers": [{"uri": f"{path.stem}.bin", "byteLength": len(positions + indices)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(corners),
                "type": "VEC3",
                "min": corners.min(axis=0).tolist(),
                "max": corners.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"},
        ],
    }
    path.write_text(json.dumps(content))


def write_dae(path: Path, size: tuple[float, float, float]) -> None:
    """Write a green box whose transparency of 0 says, by its letter, that it is invisible."""
    corners, faces = box(size)
    texts = (" ".join(map(str, array.ravel().tolist())) for array in (corners, faces))
    path.write_text(DAE.format(numbers=next(texts), indices=next(texts)), encoding="utf-8")


@pytest.mark.parametrize(
    ("visual", "meshes"),
    [(STL, "loaded"), (GLTF, "loaded"), (COLLADA, "loaded"), ("", "none")],
    ids=["stl", "gltf", "collada", ""],
)
def test_links_are_drawn_as_their_mesh_or_as_capsules(
    opened: Page, tmp_path: Path, visual: str, meshes: str
) -> None:
    page = opened
    folder = tmp_path / "acme"
    (folder / "meshes").mkdir(parents=True)
    (folder / "robot.yaml").write_text(ROBOT)
    (folder / "acme.urdf").write_text(URDF.format(visual=visual))
    write_stl(folder / "meshes" / "arm.stl", (100.0, 100.0, 600.0))
    write_gltf(folder / "meshes" / "arm.gltf", (0.1, 0.1, 0.6), [0.0, 0.6, 0.0, 1.0])
    write_dae(folder / "meshes" / "arm.dae", (0.1, 0.1, 0.6))
    with served_page(tmp_path, robot=str(folder / "robot.yaml")) as (arm, server):
        page.goto(server.url)
        canvas = page.locator("#canvas")
        expect(canvas).to_have_attribute("data-meshes", meshes)
        shows(page, 1, "+0.0000 rad")
        upright = picture(page)
        points = np.array([[0.0, 0.0, 0.5], [0.5 * np.sin(1.2), 0.0, 0.5 * np.cos(1.2)]])
        both = pixels(page, points, upright.shape)
        if visual in (GLTF, COLLADA):
            column, row = both[0].round().astype(int)
            red, green, blue = upright[row, column]
            assert green > 1.5 * max(red, blue), upright[row, column]  # its own material
        move(arm, [1.2])
        shows(page, 1, "+1.2000 rad")
        assert min(differences(upright, picture(page), both)) > BENT
        page.goto("about:blank")
