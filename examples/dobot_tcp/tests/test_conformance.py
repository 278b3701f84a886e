"""The backend passes the conformance checks of robotd. This takes three minutes."""

from __future__ import annotations

import subprocess
import sys


def test_the_backend_conforms() -> None:
    robot = ["--robot", "dobot_cr3a", "--set", "engine.stale_after_s=0.5"]
    command = ["conform", "--backend", "dobot_tcp_fake", *robot]
    done = subprocess.run(
        [sys.executable, "-m", "robotd", *command],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
