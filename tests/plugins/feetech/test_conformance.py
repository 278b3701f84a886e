"""Feetech servos pass the conformance kit, on their simulated bus and in real time.

All of it: ``robotd conform --backend feetech_stand_in --robot so101`` where this is installed.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.plugins.serial_servo.kit_parts import DAILY, PARTS, install, require_conformance

from robotd_conformance.checks.conftest import SAFE_ORDER

THREE_SERVOS = str(Path(__file__).parent / "three_servos.yaml")


@pytest.fixture
def backend(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    module = "tests.plugins.feetech.stand_in_backend"
    return install(tmp_path, monkeypatch, "feetech_stand_in", module)


def test_the_parts_are_the_kit() -> None:
    assert {theme for themes in PARTS.values() for theme in themes} == set(SAFE_ORDER)


def test_three_servos_switch_and_fail_as_the_kit_asks(backend: str) -> None:
    assert len(require_conformance(backend, THREE_SERVOS, *DAILY).passed) > 30


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("part", PARTS)
def test_the_so101_passes(part: str, backend: str) -> None:
    require_conformance(backend, "so101", *PARTS[part])
