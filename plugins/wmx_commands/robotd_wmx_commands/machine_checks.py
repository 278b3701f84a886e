"""Checks of a machine for WMX that need neither SDK nor backend."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from robotd.api import Finding

SDK_ROOTS = (Path("/opt/wmx3"), Path("/opt/lmx"))
HEADERS = ("WMX3Api.h", "CoreMotionApi.h", "AdvancedMotionApi.h", "IOApi.h", "EcApi.h")
LIBRARIES = ("wmx3api", "coremotionapi", "advancedmotionapi", "ioapi", "ecapi", "imdll")
CYCLIC_LIBRARY = "cyclicbufferapi"
REALTIME, LATENCY = Path("/sys/kernel/realtime"), Path("/dev/cpu_dma_latency")
ISOLATED = Path("/sys/devices/system/cpu/isolated")
NETWORK = Path("/sys/class/net")
CAP_SYS_NICE, CAP_IPC_LOCK = 23, 14  # linux/capability.h
ELF_MACHINES = {"x86_64": 62, "aarch64": 183}  # e_machine of /usr/include/elf.h
ARCHIVE, ELF = b"!<arch>\n", b"\x7fELF"
MAX_FILES = 2000  # that are looked at for an ENI file
PAGE = "robotd docs how-to/wmx"


def default_sdk_root() -> Path:
    """Return the SDK root of a build: the variable's, or the first existing."""
    if named := os.environ.get("WMX3_SDK_PATH"):
        return Path(named)
    return next((root for root in SDK_ROOTS if root.is_dir()), SDK_ROOTS[0])


def check_machine(root: Path) -> Iterator[Finding]:
    """Architecture, kernel, Python and compiler."""
    machine = platform.machine()
    supported = machine in ELF_MACHINES
    advice = "" if supported else f"the SDK is for {' and '.join(ELF_MACHINES)}"
    text = f"{machine}, Linux {platform.release()}"
    yield Finding("ok" if supported else "failed", text, advice)
    yield Finding("ok", f"Python {platform.python_version()} at {sys.executable}")
    if compiler := shutil.which("c++") or shutil.which("g++"):
        yield Finding("ok", f"C++ compiler {compiler}")
    else:
        yield Finding("warning", "no C++ compiler", "the backend is compiled: apt install g++")
    if REALTIME.exists():
        yield Finding("ok", "real-time kernel")
    else:
        yield Finding("warning", "no real-time kernel", "the vendor recommends PREEMPT_RT")


def check_sdk(root: Path) -> Iterator[Finding]:
    """Headers and libraries of the SDK."""
    if not root.is_dir():
        advice = "install the WMX3 SDK (3.5 or newer); one elsewhere: set WMX3_SDK_PATH or --sdk"
        yield Finding("failed", f"no SDK at {root}", advice)
        return
    yield Finding("ok", f"SDK at {root}")
    folders = (root / "include", root / "sample" / "Header")
    absent = [name for name in HEADERS if not any((at / name).is_file() for at in folders)]
    if absent:
        what = f"no header {', '.join(absent)} in {folders[0]} or {folders[1]}"
        yield Finding("failed", what, "install the SDK's development files")
    for name in LIBRARIES:
        yield _library(root / "lib", name)
    cyclic = _library(root / "lib", CYCLIC_LIBRARY)
    if cyclic.verdict == "ok" and (any((at / "CyclicBufferApi.h").is_file() for at in folders)):
        yield cyclic
    else:
        what = "no cyclic buffers (CyclicBufferApi.h, libcyclicbufferapi)"
        yield Finding("warning", what, "the backend works without: trajectories run as splines")


def _library(folder: Path, name: str) -> Finding:
    found = sorted(path for path in folder.glob(f"lib{name}.*") if path.is_file())
    if not found:
        return Finding("failed", f"no library {name} in {folder}", "reinstall the SDK")
    for path in found:
        if problem := _library_problem(path):
            return Finding("failed", f"{path} {problem}", "reinstall the SDK for this machine")
    return Finding("ok", f"{name}: {', '.join(path.name for path in found)}")


def _library_problem(path: Path) -> str:
    """Return why a file is not a library for this machine, or ""."""
    with path.open("rb") as file:
        head = file.read(20)
    if head.startswith(ARCHIVE):
        return ""
    if not head.startswith(ELF):
        return "is empty" if not head else "is neither a shared library nor an archive"
    wanted = ELF_MACHINES.get(platform.machine())
    machine = int.from_bytes(head[18:20], "little")
    return "" if wanted in (None, machine) else f"is not for {platform.machine()}"


def check_permissions(root: Path) -> Iterator[Finding]:
    """Root or capabilities, and what a real-time process needs."""
    wanted = f"run as root, or give the Python program the capabilities ({PAGE})"
    if os.geteuid() == 0:
        yield Finding("ok", "running as root")
    else:
        for bit, name in (CAP_SYS_NICE, "CAP_SYS_NICE"), (CAP_IPC_LOCK, "CAP_IPC_LOCK"):
            present = bool(_capabilities() >> bit & 1)
            if present:
                yield Finding("ok", f"{name} present")
            else:
                yield Finding("warning", f"{name} missing", wanted)
    if os.access(LATENCY, os.W_OK):
        yield Finding("ok", f"{LATENCY} writable")
    else:
        yield Finding("warning", f"{LATENCY} not writable: cores may sleep", wanted)


def check_cores(root: Path) -> Iterator[Finding]:
    """Cores that Linux leaves to the engine."""
    isolated = ISOLATED.read_text("ascii").strip() if ISOLATED.exists() else ""
    if isolated:
        yield Finding("ok", f"isolated cores: {isolated} of {os.cpu_count()}")
    else:
        advice = f"isolcpus, nohz_full and rcu_nocbs on the kernel's command line ({PAGE})"
        yield Finding("warning", f"none of {os.cpu_count()} cores is isolated", advice)


def check_network_cards(root: Path) -> Iterator[Finding]:
    """Network cards with a device behind them, and whether one can be the fieldbus."""
    cards = sorted(path for path in NETWORK.glob("*") if (path / "device").exists())
    for card in cards:
        up = (card / "operstate").read_text("ascii").strip()
        driver = (card / "device" / "driver").resolve().name
        yield Finding("ok", f"network card {card.name}: {driver}, link {up}")
    if len(cards) < 2:
        what = f"{len(cards) or 'no'} network card{'' if len(cards) == 1 else 's'} in Linux"
        advice = (
            "EtherCAT needs a card of its own, which the engine's driver takes from Linux:"
            " it may be missing here, but then the SDK's configuration has to name it"
        )
        yield Finding("warning", what, advice)


def check_eni(root: Path) -> Iterator[Finding]:
    """The EtherCAT network information file, which lists for the master what is connected."""
    if not root.is_dir():
        return
    files = [path for _, path in zip(range(MAX_FILES), root.rglob("*.xml"), strict=False)]
    found = [path for path in files if _is_eni(path)]
    if found:
        yield Finding("ok", f"ENI file {', '.join(map(str, found))}")
    else:
        advice = "export one with the SDK's EtherCAT configurator, on the network that is connected"
        yield Finding("warning", f"no ENI file below {root}", advice)


def _is_eni(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return b"<EtherCATConfig" in file.read(4096)
    except OSError:
        return False


def _capabilities() -> int:
    """The effective capabilities of this process, as a bit mask."""
    for line in Path("/proc/self/status").read_text("ascii").splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
