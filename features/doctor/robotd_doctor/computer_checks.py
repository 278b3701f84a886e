"""Kernel, real-time settings, cores, interrupts, limits, clock and disk of this computer."""

from __future__ import annotations

import os
import platform
import resource
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

from robotd.api import Finding, MachineContext
from robotd.api.commands import MAX_OPEN_FILES, realtime_permitted

KERNEL, CPUS, IRQS = Path("/sys/kernel"), Path("/sys/devices/system/cpu"), Path("/proc/irq")
RUNTIME = Path("/proc/sys/kernel/sched_rt_runtime_us")
RECORDINGS_BYTES = 2 * 2**30  # of the recorder's folder, by default
DEFAULT_PRIORITY = 60  # cycle.realtime_priority
MEMORY_BYTES = 2**30
TOOL_S = 5.0


def check_computer(context: MachineContext) -> Iterator[Finding]:
    """Yield the findings about the computer; the highest priority of the robots is asked for."""
    yield from _kernel()
    priorities = [robot.cycle.realtime_priority for robot in context.robots]
    yield _priority(max(priorities, default=DEFAULT_PRIORITY))
    yield _realtime_share()
    yield from _cores()
    yield _governor()
    yield from _interrupts()
    yield from _limits()
    yield _clock()
    yield from _space()


def _kernel() -> Iterator[Finding]:
    release = f"Linux {platform.release()}, {platform.machine()}"
    if read(KERNEL / "realtime") == "1":
        yield Finding("ok", f"{release}, PREEMPT_RT")
        return
    advice = "fit for 500 Hz on a quiet computer; for more: apt install linux-image-rt-amd64"
    yield Finding("warning", f"{release}, no real-time kernel", advice)


def _priority(priority: int) -> Finding:
    if not priority or realtime_permitted(priority):
        return Finding("ok", f"real-time priority {priority} is granted")
    advice = (
        f"echo '{os.environ.get('USER') or '*'} - rtprio {priority}' |"
        " sudo tee /etc/security/limits.d/robotd.conf, then log in again"
    )
    return Finding("warning", f"real-time priority {priority} is not granted", advice)


def _realtime_share() -> Finding:
    runtime = read(RUNTIME)
    if runtime in ("-1", ""):
        return Finding("ok", "real-time threads may use all of a core")
    return Finding("ok", f"real-time threads may use {int(runtime) / 1e4:.0f} % of each second")


def _cores() -> Iterator[Finding]:
    count, isolated = os.cpu_count() or 1, read(CPUS / "isolated")
    allowed = len(os.sched_getaffinity(0))
    if allowed < count:
        yield Finding("ok", f"{allowed} of {count} cores are allowed for this process")
    if isolated:
        yield Finding("ok", f"{count} cores, isolated: {isolated}")
    elif count == 1:
        advice = "robotd, bus and middleware share it: use a computer with two cores or more"
        yield Finding("warning", "one core", advice)
    else:
        advice = (
            f"for 1 kHz: isolcpus={count - 1} on the kernel's command line, and"
            f" CPUAffinity={count - 1} in the service, or taskset -c {count - 1}"
        )
        yield Finding("ok", f"{count} cores, none isolated", advice)


def _governor() -> Finding:
    governors = {read(path) for path in CPUS.glob("cpu[0-9]*/cpufreq/scaling_governor")} - {""}
    if not governors:
        return Finding("ok", "the frequency of the cores is not scaled by Linux")
    if governors == {"performance"}:
        return Finding("ok", "frequency governor: performance")
    advice = "sudo cpupower frequency-set -g performance"
    return Finding("warning", f"frequency governor: {', '.join(sorted(governors))}", advice)


def _interrupts() -> Iterator[Finding]:
    isolated = _core_set(read(CPUS / "isolated"))
    if not isolated:
        return
    on_isolated = [
        path.parent.name
        for path in IRQS.glob("[0-9]*/smp_affinity_list")
        if _core_set(read(path)) & isolated
    ]
    if on_isolated:
        others = ",".join(map(str, sorted(set(range(os.cpu_count() or 1)) - isolated)))
        advice = f"for each: echo {others} | sudo tee /proc/irq/N/smp_affinity_list"
        text = f"{len(on_isolated)} interrupts may run on isolated cores: {_some(on_isolated)}"
        yield Finding("warning", text, advice)
    else:
        yield Finding("ok", "no interrupt may run on an isolated core")


def _limits() -> Iterator[Finding]:
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    if files != resource.RLIM_INFINITY and files < MAX_OPEN_FILES:
        advice = "echo '* - nofile 4096' | sudo tee -a /etc/security/limits.d/robotd.conf"
        yield Finding("warning", f"{files} open files are allowed, {MAX_OPEN_FILES} needed", advice)
    else:
        yield Finding("ok", "enough open files are allowed")
    locked = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]
    if locked == resource.RLIM_INFINITY or locked >= MEMORY_BYTES:
        yield Finding("ok", "memory may be locked")
    else:
        advice = "echo '* - memlock unlimited' | sudo tee -a /etc/security/limits.d/robotd.conf"
        text = f"{locked // 1024} kB of memory may be locked: masters of buses lock theirs"
        yield Finding("warning", text, advice)


def _clock() -> Finding:
    synchronized = tool("timedatectl", "show", "--property=NTPSynchronized", "--value").strip()
    if synchronized == "yes":
        return Finding("ok", "the clock is synchronized")
    tracking = tool("chronyc", "-c", "tracking").strip()
    if tracking and not tracking.endswith("Not synchronised"):
        return Finding("ok", "the clock is synchronized by chrony")
    advice = "robots and clients on several computers compare stamps: sudo apt install chrony"
    state = "not synchronized" if synchronized == "no" else "not known to be synchronized"
    return Finding("warning", f"the clock is {state}", advice)


def _space() -> Iterator[Finding]:
    from robotd_recording.recording_folder import default_folder

    folder = default_folder()
    place = next(candidate for candidate in (folder, *folder.parents) if candidate.exists())
    free = shutil.disk_usage(place).free
    if free < RECORDINGS_BYTES:
        advice = "remove old recordings, or set recorder.folder to another disk"
        yield Finding("warning", f"{free / 2**30:.1f} GiB free at {place}", advice)
    else:
        yield Finding("ok", f"{free / 2**30:.0f} GiB free for recordings, at {place}")
    shared = shutil.disk_usage("/dev/shm").free  # noqa: S108 - of the middleware
    if shared < 64 * 2**20:
        advice = (
            "robotd removes segments of killed processes when it starts; docker: --shm-size 64m"
        )
        yield Finding("warning", f"{shared // 2**20} MiB of shared memory are free", advice)


def read(path: Path) -> str:
    """Return the text of a file without white space around it; "" without one."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def tool(*command: str) -> str:
    """Return the output of a command line tool; "" where it fails or is missing."""
    try:
        done = subprocess.run(  # noqa: S603 - fixed commands
            command, capture_output=True, text=True, timeout=TOOL_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


def _core_set(text: str) -> set[int]:
    """Return the cores of a list such as ``0-2,5``."""
    found: set[int] = set()
    for part in filter(None, text.split(",")):
        first, _, last = part.partition("-")
        if first.isdecimal():
            found.update(range(int(first), int(last or first) + 1))
    return found


def _some(words: list[str]) -> str:
    return ", ".join(words[:8]) + (", ..." if len(words) > 8 else "")
