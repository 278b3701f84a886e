"""State of the process that belongs to the program, not to a backend."""

from __future__ import annotations

import gc
import locale
import logging
import os
import resource
import signal
import socket
import sys
import threading
from pathlib import Path

import numpy as np

LIMITS = (resource.RLIMIT_NOFILE, resource.RLIMIT_CORE, resource.RLIMIT_STACK, resource.RLIMIT_AS)
DEFAULT_SWITCH_INTERVAL_S = 0.005  # the control loop sets a shorter one
SIGNALS = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGUSR1,
    signal.SIGCHLD,
    signal.SIGPIPE,
)


def surroundings() -> dict[str, object]:
    """Return what a library of a device may change in its process, and must not."""
    mask = os.umask(0)
    os.umask(mask)
    return {
        "signal handlers": [signal.getsignal(number) for number in SIGNALS],
        "working folder": str(Path.cwd()),
        "locale": locale.setlocale(locale.LC_ALL),
        "file mask": mask,
        "environment": {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTEST", "ROBOTD"))
        },
        "switch interval": sys.getswitchinterval() <= DEFAULT_SWITCH_INTERVAL_S,
        "garbage collector": gc.isenabled(),
        "floating-point errors": np.geterr(),
        "log level": logging.getLogger().level,
        "log threshold": logging.root.manager.disable,
        "recursion limit": sys.getrecursionlimit(),
        "module path": list(sys.path),
        "default socket time-out": socket.getdefaulttimeout(),
        "stack size of threads": threading.stack_size(),
        "resource limits": [resource.getrlimit(kind) for kind in LIMITS],
        "priority": os.getpriority(os.PRIO_PROCESS, 0),
    }
