"""``robotd conform`` on the stand-in, which also plays the person at the bench.

``conform.py ROBOT [ARG...]``: a robot's name or file, and what ``robotd conform`` shall get.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from robotd.descriptor import load_robot_descriptor
from standin_build import BUILD, SDK, build_all

TESTS = Path(__file__).resolve().parent
BENCH = BUILD / "bench"  # metadata of the backend wmx_standin


def environment() -> dict[str, str]:
    """Environment of the checks: plugin, fault injector and engine."""
    info = BENCH / "wmx_standin-0.dist-info"
    info.mkdir(parents=True, exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: wmx-standin\nVersion: 0\n")
    (info / "entry_points.txt").write_text("[robotd.backends]\nwmx_standin = standin_backend\n")
    path = os.pathsep.join(map(str, (build_all(), BENCH, TESTS)))
    return os.environ | {
        "PYTHONPATH": path,
        "PYTHONSAFEPATH": "1",  # the sources in this folder lack the compiled module
        "WMX_STANDIN_SHM": f"wmx-conform-{os.getpid()}",
    }


def main(robot: str, *arguments: str) -> int:
    variables = environment()
    port = [str(SDK / "bin" / "standin-port")]
    drives = load_robot_descriptor(robot).axes
    try:
        subprocess.run([*port, "topology", str(drives), "1"], env=variables, check=True)
        command = ["-m", "robotd", "conform", "--backend", "wmx_standin", "--robot", robot]
        # pytest would take up the conftest.py of the folder that it is called in.
        return subprocess.call(
            [sys.executable, *command, *arguments],
            env=variables,
            cwd=BENCH,
            stdin=subprocess.DEVNULL,
        )
    finally:
        subprocess.run([*port, "reset"], env=variables, check=True)
        Path("/dev/shm", variables["WMX_STANDIN_SHM"]).unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
