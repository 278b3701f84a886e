"""A drive whose frames do not hold the mode display: its mode is changed at rest only."""

from __future__ import annotations

import pytest
from tests.plugins.cia402.looped_drive import FAST, LoopedDrive, idle

from robotd.api import NotReady, Operation
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import INPUTS, MODE_DISPLAY

STEP = 0.004  # of a stream, rad in each period


def test_a_move_that_comes_in_a_stop_of_another_mode_leaves_the_stop_alone() -> None:
    drive = LoopedDrive()
    drive.objects.inputs = tuple(index for index in INPUTS if index != MODE_DISPLAY)
    drive.commands.enable(5.0)
    drive.commands.prepare_stream()
    drive.commands.begin_stream()
    axis = drive.axis
    for period in range(50):
        axis.follow(STEP * period, STEP / 0.004)
        drive.run(0.004)
    drive.commands.stop()
    drive.run(0.004)
    velocity = axis.setpoint.velocity
    assert velocity > 0.5
    with pytest.raises(NotReady, match="it moves, and its mode is changed by SDO, at rest only"):
        drive.commands.move(0.0, FAST)
    assert axis.mode.requested is OperationMode.CYCLIC_POSITION
    assert axis.activity.operation is Operation.STOPPING
    assert axis.setpoint.velocity == velocity
    idle(drive)
    drive.commands.move(0.0, FAST)
    idle(drive)
    assert abs(axis.report.position) < 1e-3
