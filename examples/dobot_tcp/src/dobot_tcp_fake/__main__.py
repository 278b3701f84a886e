"""``python -m dobot_tcp_fake [DASHBOARD MOTION FEEDBACK FAULTS]``: ports; 0 is any free one.

It runs until its standard input ends.
"""

from __future__ import annotations

import asyncio
import sys

from dobot_tcp_fake.arm import Arm
from dobot_tcp_fake.controller import Controller

DEFAULT_PORTS = (29999, 30003, 30004, 0)

if __name__ == "__main__":
    ports = [int(port) for port in sys.argv[1:]] or list(DEFAULT_PORTS)
    asyncio.run(Controller(Arm()).serve(ports))
