"""Pictures of the drawn arm, and its pixels."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.image import imread
from playwright.sync_api import Page, expect
from tests.features.harness import Observed

from robotd.descriptor.urdf import read_urdf

NUMBER = r"[+−]\d+\.\d+"


def move(arm: Observed, positions: list[float]) -> None:
    with arm.goal(positions, 2.0):
        arm.step(2.4)


def shows(page: Page, joint: int, text: str) -> None:
    """Wait until the table shows the position of a joint."""
    row = page.locator(f"tbody[data-axis=joint{joint}]")
    expect(row).to_contain_text(text)


def picture(page: Page) -> np.ndarray:
    """The drawn robot: shape (height, width, 3), 0 to 255."""
    overlay = "each => each.querySelectorAll('button, ul').forEach(own => own.hidden = {})"
    page.locator("#view").evaluate(overlay.format("true"))
    data = page.locator("#canvas").screenshot()
    page.locator("#view").evaluate(overlay.format("false"))
    return imread(io.BytesIO(data), format="png")[:, :, :3] * 255


def pixels(page: Page, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Column and row of points (n, 3) of the robot, by the projection of the page."""
    text = page.locator("#canvas").get_attribute("data-projection")
    assert text is not None
    matrix = np.array([*map(float, text.split())]).reshape(4, 4)
    seen = np.c_[points, np.ones(len(points))] @ matrix.T
    seen = seen[:, :2] / seen[:, 3:]
    return np.c_[(seen[:, 0] + 1) / 2 * shape[1], (1 - seen[:, 1]) / 2 * shape[0]]


def link_points(arm: Observed) -> np.ndarray:
    """Points inside the upper arm, the forearm and the wrist, where the joints are now."""
    urdf = arm.robot.descriptor.urdf
    assert urdf is not None
    robot, names = read_urdf(urdf), arm.robot.joint_names
    positions = dict(zip(names, arm.robot.image.position.tolist(), strict=True))
    upper, fore = (robot.pose(link, positions) for link in ("link2", "link3"))
    on_upper = (upper @ [-0.137, 0.0, 0.06, 1.0])[:3]
    on_fore = (fore @ [-0.115, 0.0, 0.06, 1.0])[:3]
    return np.array([on_upper, on_fore, robot.pose("link5", positions)[:3, 3]])


def differences(first: np.ndarray, second: np.ndarray, points: np.ndarray) -> list[float]:
    """Difference of two pictures around each point."""
    found = []
    for column, row in points.round().astype(int):
        patch = np.s_[row - 1 : row + 2, column - 1 : column + 2]
        found.append(float(np.abs(first[patch] - second[patch]).max(axis=2).mean()))
    return found
