"""Dynamixel servos pass the conformance kit, on their simulated bus and in real time.

All of it: ``robotd conform --backend dynamixel_stand_in --robot omx`` where this is installed.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.plugins.serial_servo.kit_parts import DAILY, PARTS, install, require_conformance

THREE_SERVOS = str(Path(__file__).parents[1] / "feetech" / "three_servos.yaml")


@pytest.fixture
def backend(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    module = "tests.plugins.dynamixel.stand_in_backend"
    return install(tmp_path, monkeypatch, "dynamixel_stand_in", module)


def test_three_servos_switch_and_fail_as_the_kit_asks(backend: str) -> None:
    assert len(require_conformance(backend, THREE_SERVOS, *DAILY).passed) > 30


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("part", PARTS)
def test_the_omx_passes(part: str, backend: str) -> None:
    require_conformance(backend, "omx", *PARTS[part])
