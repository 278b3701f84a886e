"""Simulated drives in another process, over UDP multicast, and a robot for them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

import yaml

from robotd.descriptor import load_robot_descriptor
from robotd_canopen.bus_scan import sdo_of
from robotd_canopen.sdo import Sdo

GROUP = "239.74.163.9"
PORT = 20000 + os.getpid() % 20000  # one robot for each process of tests
ERROR_CODE, POSITION_ACTUAL = 0x603F, 0x6064
# Time-outs that outlast the stalls of a busy computer.
PATIENCE = {"heartbeat_timeout_s": 10.0, "stream_timeout_s": 10.0}
STALE_AFTER_S = 3.0
SOON_STALE = {"stale_after_s": 1.0}  # a lost drive is found before it is off its path
RATE_HZ = 100  # of the control loop: robot and drives decode every frame in Python


class ObservedDrive:
    """SDO access to a drive from outside, while no robotd uses it."""

    def __init__(self, sdo: Sdo) -> None:
        self._sdo = sdo

    def position(self) -> int:
        """In counts."""
        return int.from_bytes(self._sdo.upload(POSITION_ACTUAL), "little", signed=True)

    def error_code(self) -> int:
        """Of its fault, 0 without one."""
        return int.from_bytes(self._sdo.upload(ERROR_CODE), "little")


class DrivesProcess:
    """``robotd canopen simulate`` from ``with`` on. One thread."""

    def __init__(self, robot: str = "cr3a") -> None:
        self._robot = robot
        self._process: subprocess.Popen[str] | None = None

    @property
    def running(self) -> bool:
        return self._process is not None

    def start(self) -> None:
        """Power on; returns when all nodes are there."""
        command = [sys.executable, "-m", "robotd", "canopen", "simulate", "--robot", self._robot]
        command += ["--channel", GROUP, "--port", str(PORT)]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        assert ": nodes 1, 2" in self._answer()

    def stop(self) -> None:
        """Power off: kill the process. Twice is not an error."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def inject(self, line: str) -> None:
        """Inject a fault."""
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        assert self._answer() == "ok\n"

    @contextmanager
    def observed(self, node: int = 1) -> Iterator[ObservedDrive]:
        """One of the drives, without robotd."""
        with sdo_of("udp_multicast", f"{GROUP}#{PORT}", 1_000_000, node) as sdo:
            yield ObservedDrive(sdo)

    def _answer(self) -> str:
        assert self._process is not None
        assert self._process.stdout is not None
        return self._process.stdout.readline()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def write_robot(
    folder: Path, robot: str = "cr3a", *, rate_hz: float = RATE_HZ, **options: float
) -> Path:
    """A file of ``robot`` that finds its drives in the process above.

    Its time-outs are patient; ``options`` of canopen replace them.
    """
    bus = {"channel": GROUP, "options": {"port": PORT}}
    section = {"bus": bus, "sync_period_s": 1 / rate_hz, **PATIENCE, **options}
    content = {
        "extends": str(load_robot_descriptor(robot).path),
        "default_variant": "canopen_multicast",
        "variants": {
            "canopen_multicast": {
                "cycle": {"rate_hz": rate_hz},
                "engine": {"stale_after_s": STALE_AFTER_S},  # the robot's variant has its own
                "backends": {"canopen": section},
            }
        },
    }
    path = folder / f"{robot}.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path
