"""Network namespaces of simulated buses: open a raw socket where the bus is (Linux)."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")
_CLONE_NEWUSER, _CLONE_NEWNET = 0x1000_0000, 0x4000_0000
_NET_RAW, _SYS_ADMIN = 13, 21  # capabilities
_HINT = (
    "run as root, or in a user namespace: 'unshare --user --map-root-user robotd …' "
    "(the kernel must allow it: user.max_user_namespaces > 0, and on Ubuntu "
    "kernel.apparmor_restrict_unprivileged_userns = 0)"
)


def run_in_namespace(namespace: Path | None, action: Callable[[], Result]) -> Result:
    """Run ``action`` in a thread that is in the network namespace ``namespace``.

    A socket that it opens stays in that namespace; all other threads stay where they are.
    None: the namespace of the process. Any thread.

    Raises OSError: the namespace does not exist or may not be entered; and what ``action`` raises.
    """
    if namespace is None:
        return action()
    results: list[Result] = []
    errors: list[BaseException] = []

    def run() -> None:
        try:
            _enter(namespace)
            results.append(action())
        except BaseException as error:  # noqa: BLE001 - raised in the caller
            errors.append(error)

    thread = threading.Thread(target=run, name="bus-namespace")
    thread.start()
    thread.join()
    if errors:
        raise errors[0]
    return results[0]


def missing_rights() -> str | None:
    """Return what this process lacks to simulate a bus and to use it; None: nothing."""
    effective = _effective_capabilities()
    if effective >> _SYS_ADMIN & 1 and effective >> _NET_RAW & 1:
        return None
    return f"simulated EtherCAT slaves need network namespaces: {_HINT}"


def _enter(namespace: Path) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    descriptor = os.open(namespace, os.O_RDONLY | os.O_CLOEXEC)
    try:
        if libc.setns(descriptor, _CLONE_NEWNET) != 0:
            code = ctypes.get_errno()
            raise OSError(code, f"namespace {namespace}: {os.strerror(code)}; {_HINT}")
    finally:
        os.close(descriptor)


def _effective_capabilities() -> int:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("CapEff:"):
            return int(line.split()[1], 16)
    return 0
