"""Serve simulated servos to a client in another process, until standard input ends.

    python -m tests.plugins.serial_servo.serve sts 1 2 3 4 5 6
    python -m tests.plugins.serial_servo.serve dxl 1 2

The path of the port is printed first.
"""

from __future__ import annotations

import sys

from tests.plugins.serial_servo import dxl_servo, sts_servo
from tests.plugins.serial_servo.dxl_bus import DxlBus
from tests.plugins.serial_servo.sts_bus import StsBus


def main(family: str, *keys: str) -> None:
    ids = [int(key) for key in keys] or [1]
    bus: StsBus | DxlBus
    if family == "dxl":
        bus = DxlBus({key: dxl_servo.Servo() for key in ids})
    else:
        bus = StsBus({key: sts_servo.Servo() for key in ids})
    with bus:
        sys.stdout.write(f"{bus.port}\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    main(*sys.argv[1:])
