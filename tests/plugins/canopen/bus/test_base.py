"""A mobile base in velocity mode."""

from __future__ import annotations

import numpy as np
from tests.plugins.canopen.bus.conftest import OpenRig

from robotd.device.axes import Jog
from robotd.device.state import CommandMode
from robotd.motion.profile import Profile


def test_wheels_follow_velocities_and_stop(open_rig: OpenRig) -> None:
    with open_rig("baymax", enable=False) as harness:
        axes = harness.robot.axes
        for wheel in (0, 1):
            axes.servo(wheel, True)
            axes.set_command_mode(wheel, CommandMode.VELOCITY)
        wanted = np.array([2.0, -1.0])
        axes.jog([Jog(wheel, Profile(wanted[wheel], 5.0, 5.0)) for wheel in (0, 1)])
        harness.until(lambda: bool(np.abs(harness.image.velocity - wanted).max() < 1e-2))
        axes.stop([0, 1])
        for wheel in (0, 1):
            harness.idle(wheel)
        assert np.abs(harness.image.velocity).max() < 1e-2
