"""No alarm where there is no fault: other rates, kinds and numbers of axes, poses, and devices.

Each line of ``TABLE`` runs the themes that it is about; ``ROBOTD_WHOLE_KIT=1`` runs the whole kit
on all of them, which takes half an hour.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from tests.features.conformance.runs.conftest import InstallPlugin
from tests.features.conformance.runs.kit import run_kit

WHOLE = "ROBOTD_WHOLE_KIT" in os.environ
NEAR_LIMITS = ("test_whole_streams.py", "test_setpoints.py")
RATES = ("test_feedback.py", "test_shown_motion.py", "test_setpoints.py")


@dataclass(frozen=True)
class Kind:
    """A robot with equal joints, and the device that drives it.

    Attributes:
        joints, rate_hz, lower, upper, start: its joints; in m where they are prismatic.
        options: of the simulation, besides ``start``.
        backend: name, or class of ``installed``.
        themes: that it is about.
        refused: names of checks for which there is no room.
    """

    joints: int = 2
    rate_hz: float = 100.0
    lower: float = -3.0
    upper: float = 3.0
    start: float = 0.0
    prismatic: bool = False
    options: dict[str, Any] = field(default_factory=dict)
    backend: str = "sim"
    themes: tuple[str, ...] = NEAR_LIMITS
    refused: frozenset[str] = frozenset()

    def write(self, path: Path) -> None:
        unit = "m" if self.prismatic else "rad"
        kind = {"type": "prismatic"} if self.prismatic else {}
        joints = [
            {
                "name": f"joint{axis + 1}", "axis": axis, **kind,
                f"lower_{unit}": self.lower, f"upper_{unit}": self.upper,
                f"velocity_{unit}_s": 2.0, f"acceleration_{unit}_s2": 8.0,
            }
            for axis in range(self.joints)
        ]  # fmt: skip
        options = {"initial_position_rad": self.start, **self.options}
        robot = {
            "schema": 1, "name": "faultless", "axes": self.joints, "joints": joints,
            "cycle": {"rate_hz": self.rate_hz}, "backends": {"sim": options, self.backend: options},
        }  # fmt: skip
        path.write_text(json.dumps(robot), encoding="utf-8")


TABLE = {
    "10 Hz": Kind(rate_hz=10.0, themes=RATES),
    "50 Hz": Kind(rate_hz=50.0, themes=RATES),
    "100 Hz": Kind(themes=RATES),
    "500 Hz": Kind(rate_hz=500.0, themes=("test_feedback.py", "test_shown_motion.py")),
    "1000 Hz": Kind(rate_hz=1000.0, themes=("test_feedback.py",)),
    "2000 Hz": Kind(rate_hz=2000.0, themes=("test_ageing.py",)),
    "one axis": Kind(1),
    "twelve axes": Kind(12, themes=("test_whole_streams.py", "test_feedback.py")),
    "prismatic": Kind(lower=-0.4, upper=0.8, prismatic=True),
    "near the upper limits": Kind(start=2.96),
    "near the lower limits": Kind(start=-2.96),
    "at the upper limits": Kind(start=2.9999),
    "prismatic, near a limit": Kind(lower=0.0, upper=0.5, start=0.49, prismatic=True),
    "far from zero": Kind(lower=-300.0, upper=300.0, start=250.0),
    "slow start": Kind(
        options={"open_delay_s": 1.0, "communication_delay_s": 1.5}, themes=("test_connection.py",)
    ),
    "without I/O and fieldbus": Kind(backend="AxesAlone", themes=("test_io.py", "test_faults.py")),
    "without capabilities": Kind(
        backend="PositionsAlone", themes=(*NEAR_LIMITS, "test_late_effects.py")
    ),
    "read-only": Kind(backend="ReadOnly", themes=("test_feedback.py", "test_units.py")),
}
DAILY = {"50 Hz", "near the upper limits"}


@pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, id=name, marks=[pytest.mark.daily] if name in DAILY else [])
        for name, kind in TABLE.items()
    ],
)
def test_no_alarm(kind: Kind, tmp_path: Path, install_plugin: InstallPlugin) -> None:
    robot = tmp_path / "faultless.yaml"
    kind.write(robot)
    backend = kind.backend if kind.backend == "sim" else install_plugin(kind.backend)
    outcome = run_kit(backend, *(() if WHOLE else kind.themes), robot=str(robot))
    assert outcome.failed == {}
    assert set(outcome.refused) <= kind.refused
    assert outcome.passed or outcome.skipped
