"""Simulated CANopen drives for ``stalls``, in another process than the robot."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.plugins.canopen.bus.drives_process import PORT, write_robot
from tools.endurance.stalled_robot import MotorRecorder

from robotd.api import load_robot_descriptor, validate_section
from robotd_canopen.options import CanopenOptions
from robotd_canopen.simulated_robot import simulated_network

RATE_HZ = 250
RECEIVE_BUFFER = 4_000_000  # bytes


def lost_frames() -> int:
    """Frames that the kernel has dropped because a process did not read them in time."""
    rows = Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]
    fields = [row.split() for row in rows]
    return sum(int(field[-1]) for field in fields if int(field[1].split(":")[1], 16) == PORT)


@contextmanager
def drives(folder: Path) -> Iterator[tuple[str, MotorRecorder]]:
    """A CR3A's drives on UDP multicast; the robot file for them, and a recorder of the motors."""
    robot_file = str(write_robot(folder, rate_hz=RATE_HZ))
    robot = load_robot_descriptor(robot_file)
    options = validate_section(robot, "backends.canopen", CanopenOptions)
    with simulated_network(robot, options) as network:
        # On a loaded computer this process stalls, too. No frame may be lost by that.
        bus_socket = network._bus._multicast._socket  # type: ignore[attr-defined]
        bus_socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        motors = network._machine
        yield robot_file, MotorRecorder.of_drives(motors)
