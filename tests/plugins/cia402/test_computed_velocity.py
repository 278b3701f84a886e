"""Velocity of a drive whose frames do not hold 0x606C, and torque without 0x6077."""

from __future__ import annotations

import math

import pytest
from tests.plugins.cia402.looped_drive import PERIOD_S, LoopedObjects

from robotd_cia402.drive_access import DriveReport
from robotd_cia402.object_numbers import INPUTS, POSITION, TORQUE, VELOCITY
from robotd_cia402.options import DriveOptions
from robotd_cia402.scaling import Scaling

COUNTS = 1000.0
SPEED = 0.5  # rad/s


class Moving(LoopedObjects):
    """Drive that moves at a constant speed and reports positions only."""

    def __init__(self) -> None:
        super().__init__(0)
        self.inputs = frozenset(INPUTS) - {VELOCITY, TORQUE}
        self._complete = True
        scaling = Scaling(DriveOptions(axis=0, counts_per_rad=COUNTS), 1.0, None)
        self.report = DriveReport(self, scaling)
        self.report.period_s = PERIOD_S

    def step(self, frames: int = 1, speed: float = SPEED) -> float:
        self.frames += frames
        self._taken[INPUTS.index(POSITION)] += round(speed * frames * PERIOD_S * COUNTS)
        self.report.update()
        return self.report.velocity


@pytest.mark.parametrize("turn", [1, 4, 20])
def test_the_velocity_is_that_of_the_positions(turn: int) -> None:
    drive = Moving()
    velocities = [drive.step(turn) for _ in range(20)]
    assert velocities[1:] == pytest.approx([SPEED] * 19)
    assert math.isnan(drive.report.torque)
    assert [drive.step(turn, 0.0) for _ in range(10)][-1] == 0.0


def test_an_axis_without_new_positions_does_not_seem_to_rest() -> None:
    drive = Moving()
    for _ in range(10):
        drive.step()
    for _ in range(50):
        drive.report.update()  # the frames of the drive are late
    assert drive.report.velocity == pytest.approx(SPEED)


def test_a_node_that_was_lost_begins_anew() -> None:
    drive = Moving()
    for _ in range(10):
        drive.step()
    drive.node.online = False
    assert drive.step(1000) == 0.0
    drive.node.online = True
    assert drive.step() == 0.0
    assert drive.step() == pytest.approx(SPEED)
