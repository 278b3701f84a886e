"""Values of a CAN network for ``/diagnostics``, by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice

from robotd.api import NANOSECONDS
from robotd_canopen.master import Master

_SHOWN = 5  # latest emergencies


def diagnostic_values(network: Master) -> Mapping[str, str]:
    """Loads, counters, SYNC, and the latest emergencies. Any thread."""
    bus, counters = network.bus, network.bus.counters
    silent = [
        f"node {node.id}: {node.lost_heartbeats}"
        for node in network.nodes.values()
        if node.lost_heartbeats
    ]
    return {
        "bus load (%)": f"{100 * bus.load:.0f}",
        "computed bus load (%)": f"{100 * network.layout.bus_load:.0f}",
        "frames received": str(counters.received),
        "frames sent": str(counters.sent),
        "malformed frames": _counted(counters.malformed, bus.last_malformed),
        "error frames": _counted(counters.error_frames, bus.last_error),
        "failed receives": str(counters.receive_errors),
        "failed sends": str(counters.send_errors),
        "lost heartbeats": ", ".join(silent) or "0",
        "largest SYNC deviation (ms)": f"{network.sync.jitter_ns / 1e6:.2f}",
        "EMCY in force": _joined(map(str, list(network.emergencies.active.values()))),
        "latest EMCY": _joined(_history(network)),
    }


def _history(network: Master) -> list[str]:
    """The latest first, with their age."""
    now_ns = network.clock.now_ns()
    latest = islice(reversed(list(network.emergencies.history)), _SHOWN)
    return [f"{each}, {(now_ns - each.time_ns) / NANOSECONDS:.1f} s ago" for each in latest]


def _counted(count: int, latest: str) -> str:
    return f"{count}, the latest: {latest}" if latest else str(count)


def _joined(texts: Iterable[str]) -> str:
    return "; ".join(texts) or "none"
