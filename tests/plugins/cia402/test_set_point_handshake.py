"""The handshake of a profile position move, frame by frame."""

from __future__ import annotations

import pytest

from robotd_cia402.controlword import Control, ModeControl, Phase
from robotd_cia402.modes import OperationMode


@pytest.mark.parametrize("frames_to_mode", [0, 1, 5])
def test_the_target_comes_before_the_bit(frames_to_mode: int) -> None:
    """The target is sent once the drive shows the mode; some read the controlword first."""
    handshake = ModeControl(OperationMode.CYCLIC_POSITION)
    handshake.begin_target()
    with_target = 0
    for frame in range(20):
        in_mode = frame >= frames_to_mode
        handshake.advance_target(0, int(in_mode), period_s=0.004)
        if handshake.bits & Control.NEW_SET_POINT:
            break
        with_target += in_mode
    assert handshake.phase is Phase.ASKING
    assert with_target >= 2
