"""Identity of a robot, for its clients."""

from __future__ import annotations

import os
import socket
from importlib.metadata import version
from typing import Any

from robotd.device.capabilities import Capability
from robotd.robot import Robot


def identity(robot: Robot, namespace: str) -> dict[str, Any]:
    """Return what distinguishes this robot from others; ``namespace`` is that of its nodes."""
    descriptor = robot.descriptor
    return {
        "robot": descriptor.name,
        "summary": descriptor.summary,
        "variant": descriptor.variant or "",
        "backend": robot.backend.name,
        "version": version("robotd"),
        "namespace": namespace,
        "computer": socket.gethostname(),
        "pid": os.getpid(),
        "simulated": Capability.SIMULATED in robot.capabilities,
    }
