"""The check list for a machine with the SDK."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from standin_build import SDK
from standin_port import port


def doctor(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "robotd", "wmx", "doctor", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_finds_the_sdk_and_asks_nothing_of_the_engine() -> None:
    done = doctor()
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"SDK at {SDK}" in done.stdout
    assert "libcoremotionapi.so" in done.stdout
    assert "error codes are those of the table" in done.stdout
    assert "engine 0" in port("show")


def test_asks_the_engine_when_told_to_and_leaves_it_as_it_was() -> None:
    done = doctor("--engine")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "engine running" in done.stdout
    assert "devices: robotd doctor" in done.stdout
    assert "licence: no complaint" in done.stdout


def test_an_invalid_licence_is_named() -> None:
    port("licence_expired", 1)
    assert "no valid licence" in doctor("--engine").stdout


def test_a_locked_engine_fails() -> None:
    port("device_locked", 1)
    done = doctor("--engine")
    assert done.returncode == 1
    assert "wmx 297 (device locked by another process)" in done.stdout


def test_a_missing_sdk_fails(tmp_path: Path) -> None:
    done = doctor("--sdk", str(tmp_path / "nothing"))
    assert done.returncode == 1
    assert "no SDK at" in done.stdout
