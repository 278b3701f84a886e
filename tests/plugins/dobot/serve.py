"""Serve the stand-in of a controller until standard input ends.

    python -m tests.plugins.dobot.serve v4 [COMMANDS MOTION FEEDBACK FAULTS]

Ports follow the generation, 0 is any free one; they are printed first. Faults are lines at the last
one, as by ``echo "trip 117" | nc 127.0.0.1 30999``.
"""

from __future__ import annotations

import asyncio
import sys

from tests.plugins.dobot.arm import Arm
from tests.plugins.dobot.controller import Controller

DEFAULT_PORTS = (29999, 30003, 30004, 30999)

if __name__ == "__main__":
    generation = sys.argv[1] if sys.argv[1:] else "v4"
    ports = [int(port) for port in sys.argv[2:]] or list(DEFAULT_PORTS)
    asyncio.run(Controller(Arm(), generation).serve(ports))
