"""Angles of quaternions against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robotd_ros.rotations import roll_pitch_yaw


@pytest.mark.parametrize("roll", [0.0, 0.3, -2.0])
@pytest.mark.parametrize("pitch", [0.0, 1.2, np.pi / 2, -np.pi / 2])
@pytest.mark.parametrize("yaw", [0.0, 0.7, 3.0])
def test_angles_of_a_quaternion_are_those_of_its_rotation(
    roll: float, pitch: float, yaw: float
) -> None:
    rotation = Rotation.from_euler("xyz", [roll, pitch, yaw])
    angles = roll_pitch_yaw(*rotation.as_quat())
    turned = Rotation.from_euler("xyz", angles)
    assert turned.as_matrix() == pytest.approx(rotation.as_matrix(), abs=1e-6)
    if abs(pitch) == np.pi / 2:
        assert angles[0] == 0.0
