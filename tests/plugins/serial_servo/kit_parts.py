"""The conformance kit in parts, for backends of serial servos: each takes up to three minutes.

The simulated servos live in real time, so that the parts take as long on a fast computer.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from tests.features.conformance.runs.conftest import announce
from tests.features.conformance.runs.kit import KitResult, run_kit

DAILY = ("rejections", "fieldbus", "enable", "guiding", "faults", "torque")
"""Themes of some seconds, about switching and about faults."""

PARTS = {
    "stops": (
        "rejections", "fieldbus", "io", "io_images", "switches", "enable", "hand_moves",
        "guiding", "payload", "wrenches", "connection", "ageing", "stopping", "stops_of_some_axes",
        "stop_ramps", "ramps", "faults", "watchdog",
    ),
    "axes": (
        "axes_apart", "resumption", "units", "neighbours", "small_and_large", "profiles",
        "overrides",
    ),
    "motion": (
        "command_sequences", "shown_motion", "while_it_happens", "extremes", "questions",
        "feedback", "last_axis", "late_effects", "velocity_commands", "streams", "setpoints",
        "whole_streams", "underrun", "dry_buffers", "silences", "trajectories", "bus_objects",
        "lost_nodes", "limits", "torque", "scaling", "scale_and_home", "parameters",
    ),
    "process": (
        "silences", "reopening", "open_again", "cost", "process", "leaks", "locks", "threads",
        "device_under_load",
    ),
    "again": ("again",),
}  # fmt: skip
"""All themes of the kit."""

ABSENT = (
    "io", "objects", "parameters_file", "hot_connect", "register_read", "scaling", "homing",
    "torque_mode", "controller_alarm", "payload",
)  # fmt: skip
NOT_APPLICABLE = "|".join(
    (
        rf"the \S+ backend does not have ({'|'.join(ABSENT)})",
        # Servos have no switches, one byte of fault bits, and no engine; torque is not measured.
        r"FaultInjector\.(press_switch|stop_engine|lose_packets): not supported",
        r"alarm 0x[0-9A-F]+: a servo has 0x3f",
        "backend measures no torque",
        "the device has no outputs",
        "the device has no wrench",
        "takes no drive in again",
        "no confirmations are kept",
        r"stream_buffer_s is 0",
        "has no axis that is not a joint",
        "each axis is guided alone",
        # Of any device in real time and in this process.
        "judged in simulated time",
        "in real time",
        "simulated in the process and ends with it",
        "--thorough",
    )
)
"""Why a check is left out on a bus of servos."""


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, backend: str, module: str) -> str:
    """Make ``module`` the backend of a distribution, for child processes, too; return its name."""
    announce(folder, backend, module)
    monkeypatch.syspath_prepend(str(folder))
    root = Path(__file__).parents[3]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(root)]))
    return backend


def require_conformance(backend: str, robot: str, *themes: str) -> KitResult:
    """Run ``themes`` of the kit; none may fail, or be left out without a good reason."""
    outcome = run_kit(backend, *(f"test_{theme}.py" for theme in themes), robot=robot)
    assert not outcome.failed
    assert not outcome.ended_early
    wrong = {
        check: reason
        for check, reason in outcome.reasons.items()
        if not re.search(NOT_APPLICABLE, reason)
    }
    assert not wrong, wrong
    # What a busy computer did not let judge is a part, and never all.
    assert len(outcome.passed) > len(outcome.inconclusive)
    return outcome
