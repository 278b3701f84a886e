"""Torque stream: held at its start, in position control and at rest after its end."""

from __future__ import annotations

import numpy as np
import pytest

from robotd.api import Capability, CommandMode
from robotd_conformance.checks.harness import STANDSTILL_RAD_S, Harness

SHARE = 0.5  # of a joint's torque limit
MOVING_RAD_S = 0.1
TIMEOUT_S = 0.2


@pytest.mark.clause("AxisDriver.stream_torque/torque")
@pytest.mark.needs(Capability.TORQUE_MODE)
def test_a_torque_moves_a_joint_until_its_source_is_lost(disabled: Harness) -> None:
    for mode in (CommandMode.TORQUE, CommandMode.POSITION):  # also while the servo is off
        disabled.robot.axes.set_command_mode(0, mode)
        disabled.periods(5)
        assert disabled.image.mode[0] == mode
    disabled.enable()
    joints = zip(disabled.robot.descriptor.joints, disabled.robot.joint_axes, strict=True)
    able = [(joint.name, axis, joint.effort_limit) for joint, axis in joints if joint.effort_limit]
    if not able:
        pytest.skip("no joint has a torque limit (joints[].torque_limit_nm)")
    name, axis, limit = able[0]
    with disabled.robot.torque_stream([name], timeout_s=TIMEOUT_S) as stream:
        with disabled.recording() as before:
            disabled.pass_time(TIMEOUT_S / 4)  # without a command
        assert np.abs(before.velocity[:, axis]).max() < STANDSTILL_RAD_S

        def moves() -> bool:
            stream.send([SHARE * limit])
            return bool(abs(disabled.image.velocity[axis]) > MOVING_RAD_S)

        disabled.until(moves, f"half of the torque limit moves {name}")
        disabled.until(lambda: stream.wait(0.0), f"{name} comes to rest without a command")
        assert stream.message == f"no command for {TIMEOUT_S:g} s"
    assert abs(disabled.image.velocity[axis]) < STANDSTILL_RAD_S
    assert disabled.image.mode[axis] == CommandMode.POSITION
