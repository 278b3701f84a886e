"""Tips of tools and work frames from touches, with noise and with poses that are too alike."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.frames.frame_calibration import frame_of_points, tool_tip

TIP, POINT = np.array([0.01, -0.02, 0.15]), np.array([0.4, 0.1, 0.05])


def touches(rotations: Rotation, noise_m: float = 0.0) -> list[FloatArray]:
    """Poses of a link whose tool touches ``POINT``."""
    random, found = np.random.default_rng(1), []
    for turn in rotations.as_matrix():
        pose = np.eye(4)
        pose[:3, :3] = turn
        pose[:3, 3] = POINT - turn @ TIP + random.normal(size=3) * noise_m
        found.append(pose)
    return found


def tilted(degrees: float, count: int = 4) -> Rotation:
    """Turns by an angle about axes that are spread in a plane, and one without."""
    angles = np.arange(count - 1) * 2.0 * np.pi / (count - 1)
    axes = np.stack([np.cos(angles), np.sin(angles), np.zeros(count - 1)], axis=1)
    return Rotation.from_rotvec(np.vstack([np.zeros(3), np.radians(degrees) * axes]))


def test_a_tip_is_found_by_four_touches() -> None:
    found = tool_tip(touches(tilted(45.0)))
    assert found.xyz_m == pytest.approx(TIP, abs=1e-9)
    assert found.point_m == pytest.approx(POINT, abs=1e-9)
    assert found.errors_m.max() < 1e-9


def test_the_error_tells_how_well_the_point_was_touched() -> None:
    found = tool_tip(touches(tilted(60.0, 8), noise_m=0.0005))
    assert 0.0002 < found.errors_m.max() < 0.002
    assert np.linalg.norm(found.xyz_m - TIP) < 0.002


def test_wider_turns_are_known_better() -> None:
    assert tool_tip(touches(tilted(60.0))).known > tool_tip(touches(tilted(30.0))).known


@pytest.mark.parametrize(
    "rotations",
    [tilted(2.0), Rotation.from_euler("z", [[0], [40], [80], [120]], degrees=True)],
    ids=["small turns", "one axis"],
)
def test_poses_that_are_too_alike_are_refused(rotations: Rotation) -> None:
    with pytest.raises(InvalidArgument, match="the poses are too alike: turn the tool"):
        tool_tip(touches(rotations))


def test_three_touches_are_too_few() -> None:
    with pytest.raises(InvalidArgument, match="3 poses: the tip of a tool needs 4 or more"):
        tool_tip(touches(tilted(45.0))[:3])


def test_a_frame_goes_through_three_points() -> None:
    turn = Rotation.from_euler("xyz", [20, -30, 70], degrees=True).as_matrix()
    origin = np.array([0.3, -0.2, 0.1])
    frame = frame_of_points(origin, origin + turn @ [0.2, 0, 0], origin + turn @ [0.05, 0.1, 0])
    assert frame[:3, :3] == pytest.approx(turn)
    assert frame[:3, 3] == pytest.approx(origin)


@pytest.mark.parametrize(
    ("on_x", "in_plane", "reason"),
    [
        ([0.01, 0, 0], [0, 0.1, 0], r"too near to each other: 10\.0 mm between two points"),
        ([0.2, 0, 0], [0.3, 0.01, 0], r"nearly in a line: 1\.9°, at least 15° at the origin"),
        ([0.2, 0, 0], [-0.3, 0.01, 0], "nearly in a line"),
    ],
)
def test_points_that_make_no_frame_are_refused(
    on_x: list[float], in_plane: list[float], reason: str
) -> None:
    with pytest.raises(InvalidArgument, match=reason):
        frame_of_points(np.zeros(3), np.array(on_x), np.array(in_plane))
