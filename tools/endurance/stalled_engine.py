"""WMX engine for ``stalls``: the stand-in of ``plugins/wmx/tests``, in another process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

PLUGIN = Path(__file__).resolve().parents[2] / "plugins" / "wmx"
AXES = 6
ROW = np.dtype([("time_ns", "<i8"), ("command", "<f8", AXES), ("position", "<f8", AXES)])


def build() -> None:
    """Build stand-in and backend. Needs ``make -C plugins/wmx tools``."""
    builder = PLUGIN / "tests" / "standin_build.py"
    subprocess.run([sys.executable, str(builder)], check=True, stdout=subprocess.DEVNULL)


@contextmanager
def engine(folder: Path) -> Iterator[tuple[dict[str, str], Callable[[], dict[str, np.ndarray]]]]:
    """Environment of a robot on an engine of its own, and its motors once both have ended."""
    memory, trace = f"wmx-stalls-{os.getpid()}", folder / "trace.bin"
    environment = os.environ | {
        "PYTHONPATH": str(PLUGIN / "build" / "site"),
        "WMX_STANDIN_SHM": memory,
        "WMX_STANDIN_TRACE": str(trace),
    }

    def motors() -> dict[str, np.ndarray]:
        rows = np.fromfile(trace, ROW)
        return {
            "times_ns": rows["time_ns"],
            "positions": rows["position"],
            "commands": rows["command"],
        }

    try:
        yield environment, motors
    finally:
        port = PLUGIN / "build" / "standin" / "sdk" / "bin" / "standin-port"
        subprocess.run([str(port), "reset"], env=environment, check=True)
        Path("/dev/shm", memory).unlink(missing_ok=True)
