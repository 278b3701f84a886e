"""Resources of a process as the kernel reports them; they must not grow."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from pathlib import Path

from tools.bench.process import CPU_CLOCK_SCHED, MIB

SHM = Path("/dev/shm")
SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")
SHARED_MEMORY = re.compile(r"(/dev/shm/\S+)")


@dataclass(frozen=True)
class Vitals:
    """One look at a process.

    Attributes:
        rss_mib: resident memory.
        threads, fds: how many it has.
        shm_files: files of /dev/shm that it has mapped; others' are not counted.
        cpu_s: processor time so far, user and system.
    """

    rss_mib: float
    threads: int
    fds: int
    shm_files: int
    cpu_s: float


def vitals(pid: int) -> Vitals:
    """Raises OSError when the process is gone."""
    folder = Path("/proc", str(pid))
    status = (folder / "status").read_text(encoding="utf-8")
    fields = dict(re.findall(r"^(VmRSS|Threads):\s+(\d+)", status, re.MULTILINE))
    return Vitals(
        rss_mib=int(fields["VmRSS"]) / MIB,
        threads=int(fields["Threads"]),
        fds=sum(1 for _ in (folder / "fd").iterdir()),
        shm_files=len(set(SHARED_MEMORY.findall((folder / "maps").read_text(encoding="utf-8")))),
        cpu_s=time.clock_gettime((~pid << 3) | CPU_CLOCK_SCHED),
    )


def shm_total() -> int:
    """Files in /dev/shm, of everybody: what processes that were killed have left is among them."""
    return sum(1 for _ in SHM.iterdir())


def shm_segments() -> int:
    """Those of Fast DDS that one process owns, of half a megabyte: what has to go with it.

    The files of a port stay for the next process on the port.
    """
    return sum(1 for path in SHM.iterdir() if SEGMENT.fullmatch(path.name))
