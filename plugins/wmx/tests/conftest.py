"""Stand-in and binding for all tests; each begins without an engine."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))
os.environ["WMX_STANDIN_SHM"] = f"wmx-test-{os.getpid()}"

from standin_build import SDK, SITE, build_all
from standin_port import port
from standin_trace import Trace

settings.register_profile("wmx", deadline=None, derandomize=True)  # as tests/conftest.py
settings.load_profile("wmx")


def pytest_sessionstart() -> None:
    build_all()
    sys.path.insert(0, str(SITE))
    os.environ["PYTHONPATH"] = str(SITE)


def pytest_sessionfinish() -> None:
    if (SDK / "bin" / "standin-port").exists():
        port("reset")
    Path("/dev/shm", os.environ["WMX_STANDIN_SHM"]).unlink(missing_ok=True)


@pytest.fixture
def trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Trace:
    """Record of the engine that the test starts."""
    path = tmp_path / "trace.bin"
    monkeypatch.setenv("WMX_STANDIN_TRACE", str(path))
    return Trace(path)


@pytest.fixture(autouse=True)
def fresh_engine() -> Iterator[None]:
    port("reset")
    yield
    port("reset")
