"""The backend's part of ``robotd wmx doctor``; the rest is tested in the core."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from standin_build import SDK
from standin_port import port


def doctor(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-m", "robotd", "wmx", "doctor", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_finds_the_sdk_and_asks_nothing_of_the_engine() -> None:
    done = doctor("--sdk", str(SDK))
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"SDK at {SDK}" in done.stdout
    assert "libcoremotionapi.so" in done.stdout
    assert "error codes are those of the table" in done.stdout
    assert "engine 0" in port("show")


def test_asks_the_engine_when_told_to_and_leaves_it_as_it_was() -> None:
    done = doctor("--sdk", str(SDK), "--engine")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "engine running" in done.stdout
    assert "devices: robotd doctor" in done.stdout
    assert "licence: no complaint" in done.stdout


def test_a_network_without_slaves_is_not_ok() -> None:
    port("topology", 0, 0)
    lines = doctor("--sdk", str(SDK), "--engine").stdout.splitlines()
    [line] = [line for line in lines if "master 0" in line]
    assert line.split()[0] == "warning"
    assert "0 slaves" in line


def test_an_invalid_licence_is_named() -> None:
    port("licence_expired", 1)
    assert "no valid licence" in doctor("--sdk", str(SDK), "--engine").stdout


def test_a_locked_engine_fails() -> None:
    port("device_locked", 1)
    done = doctor("--sdk", str(SDK), "--engine")
    assert done.returncode == 1
    assert "wmx 297 (device locked by another process)" in done.stdout
    assert "another program" in done.stdout


def test_an_sdk_that_the_binding_was_not_built_against_fails(tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(SDK, other)
    done = doctor("--sdk", str(other))
    assert done.returncode == 1
    assert f"the binding belongs to {SDK}, not to {other}" in done.stdout


def test_a_missing_engine_program_is_not_another_program(tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(SDK, other)
    (other / "bin" / "standin-engine").unlink()
    done = doctor("--sdk", str(other), "--engine")
    assert done.returncode == 1
    assert "the engine's program is missing" in done.stdout
    assert "another program" not in done.stdout


def test_a_library_that_is_missing_at_run_time_is_no_missing_backend() -> None:
    library, aside = SDK / "lib" / "libioapi.so", SDK / "lib" / "aside"
    library.rename(aside)
    try:
        done = doctor("--sdk", str(SDK))
    finally:
        aside.rename(library)
    assert done.returncode == 1
    assert "cannot be imported: ImportError: libioapi.so" in done.stdout
    assert "a library that it needs is missing" in done.stdout
