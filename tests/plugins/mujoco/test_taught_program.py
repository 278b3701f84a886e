"""A taught program picks and places, wherever the arm was and once the cube is back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.plugins.mujoco.cell import CARRIED_M, CUBE_M, cell

from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

EXAMPLE = Path(__file__).parents[3] / "examples" / "programs" / "place_cube.yaml"
STARTS = 10
FOLDED = np.array([0.0, 0.3, -1.4, -0.2, 1.2, 0.0])  # above the table
AROUND = np.array([1.2, 0.3, 0.4, 0.6, 0.6, 2.0])  # rad, of each joint


@pytest.mark.long
def test_the_cube_is_placed_from_each_of_ten_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    program, random = Program.read(EXAMPLE), np.random.default_rng(1)
    with cell() as arm:
        world, programs = arm.robot.world, arm.robot.feature(Programs)
        assert world is not None
        for _ in range(STARTS):
            arm.go(FOLDED + AROUND * random.uniform(-1.0, 1.0, 6), 3.0)
            world.reset()
            assert arm.pose("cube")[:3] == pytest.approx(CUBE_M, abs=1e-3)
            programs.run(program)
            assert programs.state.state == "done"
            assert arm.pose("cube")[:3] == pytest.approx(CARRIED_M, abs=8e-3)
            assert arm.pose("green_cube")[:2] == pytest.approx([0.5, -0.05], abs=1e-3)
