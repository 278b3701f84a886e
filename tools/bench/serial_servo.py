"""Exchange with six simulated servos in another process: its time, and lost replies.

``python -m tools.bench.serial_servo``: one sync read of 31 bytes a servo and one sync write of
goals, at 1 Mbit/s, with the reply delay of new servos and without one.
"""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np

from robotd_feetech import registers
from robotd_feetech.sts_bus import StsBus
from robotd_serial_servo.bus_scan import opened
from robotd_serial_servo.servo_bus import Goal

SERVOS = tuple(range(1, 7))
EXCHANGES = 500
DELAYS = {"reply delay 500 µs": 250, "no reply delay": 0}
SPEED = 1000


def measure(port: str, delay: int) -> tuple[np.ndarray, int]:
    """Return times of exchanges, ms, and the number of replies that were lost."""
    times, lost = [], 0
    with opened(StsBus, port, 1_000_000, 0.05) as bus:
        assert isinstance(bus, StsBus)
        for servo in SERVOS:
            bus.ping(servo)
            bus._write(servo, registers.REPLY_DELAY, bytes((delay,)))
            bus.identify(servo)  # which reads the delay
        for _ in range(EXCHANGES):
            began = time.perf_counter()
            states = bus.read(SERVOS)
            bus.write_goals({key: Goal(state.position, SPEED) for key, state in states.items()})
            times.append(1000.0 * (time.perf_counter() - began))
            lost += len(SERVOS) - len(states)
    return np.array(times), lost


def main() -> None:
    for name, delay in DELAYS.items():
        with subprocess.Popen(
            [sys.executable, "-m", "tests.plugins.serial_servo.serve", "sts", *map(str, SERVOS)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            assert process.stdout
            assert process.stdin
            times, lost = measure(process.stdout.readline().strip(), delay)
            process.stdin.close()
        median, high, highest = np.percentile(times, [50, 99, 100])
        print(f"{name}: {median:.1f} ms, p99 {high:.1f}, max {highest:.1f}, {lost} replies lost")


if __name__ == "__main__":
    main()
