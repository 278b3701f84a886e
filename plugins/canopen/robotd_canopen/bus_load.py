"""Load of a CAN bus by the cyclic traffic, with worst-case bit stuffing.

A frame with an 11-bit identifier and n data bytes has 47 + 8n bits with the interframe space,
of which 34 + 8n are subject to stuffing: at most one more bit for each four after the first
(Davis, Burns, Bril, Lukkien: Controller Area Network schedulability analysis, 2007, eq. 1).
"""

from __future__ import annotations

from collections.abc import Iterable


def frame_bits(data_bytes: int) -> int:
    """Return the bits of one data frame on the wire, worst case."""
    return 47 + 8 * data_bytes + (34 + 8 * data_bytes - 1) // 4


def wire_bits(frames: int, data_bytes: int) -> float:
    """Return the bits of ``frames`` frames with ``data_bytes`` in total, worst case."""
    return frames * (47 + 33 / 4) + data_bytes * 10


def bus_load(
    synchronous: Iterable[tuple[int, float]],
    sync_period_s: float,
    heartbeats: int,
    heartbeat_s: float,
    bitrate: int,
) -> float:
    """Return the load of the bus, 1.0 for all of it.

    Args:
        synchronous: data bytes and frames for each SYNC (0.25: each fourth) of every PDO.
        heartbeats: nodes that send one, the master included.
    """
    bits = sum(frame_bits(size) * frames for size, frames in synchronous) + frame_bits(0)
    return (bits / sync_period_s + heartbeats * frame_bits(1) / heartbeat_s) / bitrate
