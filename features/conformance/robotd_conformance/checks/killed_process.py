"""``python -m``: move all axes until the process is killed, for checks of the watchdog.

Measured positions go to standard output, one JSON array every ``REPORT_S``, from when all axes
move at their speed.
"""

# ruff: noqa: T201 - output for the parent process

from __future__ import annotations

import json
import sys

import numpy as np

from robotd.api import Capability, Profile
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.recorded_motion import jog

SPEED_RAD_S, RAMP_RAD_S2 = 0.05, 1.0
RUNNING_S, REPORT_S = 3.0, 0.02


def begin(harness: Harness, speeds: np.ndarray) -> None:
    """Start velocity commands; moves where the backend has none."""
    if harness.can(Capability.VELOCITY_MODE):
        harness.set_velocity_mode()
        ramps = Profile(SPEED_RAD_S, RAMP_RAD_S2, RAMP_RAD_S2)
        jog(harness, speeds, [ramps] * harness.count)
    else:
        harness.move(harness.all, harness.image.position + RUNNING_S * speeds)


def main(backend: str, robot: str, *overrides: str) -> None:
    """Move until the process is killed, or for ``RUNNING_S``."""
    harness = KitTarget(backend, robot or None, overrides).build(real_time=True)
    harness.start()
    begin(harness, SPEED_RAD_S * np.sign(harness.travel()))
    fast = 0.5 * SPEED_RAD_S
    harness.until(lambda: bool((np.abs(harness.image.velocity) > fast).all()), "all axes move")
    for _ in range(round(RUNNING_S / REPORT_S)):
        print(json.dumps(harness.image.copy().position.tolist()), flush=True)
        harness.pass_time(REPORT_S)
    harness.stop()


if __name__ == "__main__":
    main(*sys.argv[1:])
