"""Program: run a command where the only interfaces are a new cable; print its EtherCAT frames.

The ends of the cable are ``eth0``, for the command, and ``peer``.
"""

from __future__ import annotations

import socket
import subprocess
import sys

from robotd_ethercat.simulated.bus import ETHERTYPE
from robotd_ethercat.simulated.virtual_cable import make_cable, new_namespace

LONG_S = 120.0


def main() -> None:
    new_namespace()
    make_cable("eth0", "peer")
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE)) as peer:
        peer.bind(("peer", ETHERTYPE))
        done = subprocess.run(
            sys.argv[1:], capture_output=True, text=True, check=False, timeout=LONG_S
        )
        peer.setblocking(False)
        frames = 0
        try:
            while peer.recv(2048):
                frames += 1
        except BlockingIOError:
            pass
    sys.stdout.write(f"status {done.returncode}, {frames} frames\n{done.stdout}{done.stderr}")


if __name__ == "__main__":
    main()
