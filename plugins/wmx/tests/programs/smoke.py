"""One of each kind of call, through the binding in the folder that is named: does it work?

Prints what the editions of the SDK differ in, as far as it can be seen from Python.
"""

from __future__ import annotations

import sys
import time

sys.path.insert(0, sys.argv[1])

import _native as native
import numpy as np


def until(condition: object) -> None:
    end_s = time.monotonic() + 30.0
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end_s, "it did not happen"


device = native.Device()
device.create(native.SDK_PATH, 30_000)
device.set_name("smoke")
device.set_watchdog(30_000)
device.start_communication(30_000)
device.set_servo(0, True)
until(lambda: native.Snapshot(device).servo_on(0))
device.start_pos(0, 1.0, 10.0, 100.0, 100.0)
until(lambda: native.Snapshot(device).motion_complete(0))
assert native.Snapshot(device).position_command(0) == 1.0
device.create_spline_buffer(0, 2)
device.start_spline(0, [0], np.array([50.0, 100.0]), np.array([[1.5], [2.0]]))
until(lambda: native.Snapshot(device).position_command(0) == 2.0)
until(lambda: native.Snapshot(device).idle(0))
if native.CYCLIC_BUFFER:
    stream = native.PositionStream(device, [1.0], [3.0], [10.0], 0.002, 0.01, 0)
    stream.begin([0])
    due_ns = time.monotonic_ns()
    for step in range(1, 51):
        due_ns += 2_000_000
        time_s = step * 0.002
        stream.put(np.array([2.0 + 2.5 * time_s**2]), np.array([5.0 * time_s]), due_ns)
        time.sleep(max(0.0, (due_ns - time.monotonic_ns()) * 1e-9))
    stream.stop([0])
    until(lambda: not stream.active(0))
    # Less than the whole travel where setpoints came late: then the stream has braked.
    assert 2.0 < native.Snapshot(device).position_command(0) <= 2.05, stream.fault
    assert native.Snapshot(device).idle(0)
    stream.close()
device.set_command_mode(0, 1)
until(lambda: native.Snapshot(device).mode_feedback(0) == 1)
device.write_outputs(0, b"\x05")
assert device.read_outputs(0, 1) == b"\x05"
master = native.Master(device, 0)
assert (master.state, master.slaves[0].state, master.hot_connect) == (16, 16, "idle")
device.stop_communication(30_000)
device.close(True)  # stays, where the engine can be kept

other = native.Device()
other.create(native.SDK_PATH, 30_000)
kept = other.read_outputs(0, 1) == b"\x05"
other.close(False)
cyclic = int(native.CYCLIC_BUFFER)
print(f"kept={int(kept)} spline={native.MAX_SPLINE_AXES} cyclic={cyclic}")
