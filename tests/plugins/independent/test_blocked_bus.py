"""Frames that wait while the bus is blocked must not reach the drive when it is free again."""

from __future__ import annotations

import can.interfaces
import pytest
from tests.plugins.independent import queued_bus
from tests.plugins.independent.conftest import GROUP, PORT, OpenBench
from tests.plugins.independent.queued_bus import INTERFACES, QueuedBus

BLOCKED_PERIODS = 90
MAX_AGE_PERIODS = 3
FRAMES_PER_SYNC = 4  # SYNC, heartbeat, and two RPDOs at most


@pytest.mark.parametrize("interface", INTERFACES)
def test_frames_of_a_blocked_bus_are_not_executed_late(
    open_bench: OpenBench, monkeypatch: pytest.MonkeyPatch, interface: str
) -> None:
    """The bus is blocked for 0.9 s in motion: more than 200 frames would come at once."""
    place = queued_bus.__name__, INTERFACES[interface].__name__
    monkeypatch.setitem(can.interfaces.BACKENDS, interface, place)
    options = {"port": PORT, "hop_limit": 0}
    section = {"bus": {"interface": interface, "channel": GROUP, "options": options}}
    with open_bench(section=section) as bench:
        bench.robot.start()
        bus, master = QueuedBus.opened[-1], bench.robot.device.master
        start = bench.image.position[0]
        with bench.moving(2.9, 4.0):
            bench.until(lambda: abs(bench.image.position[0] - start) > 0.1)
            bus.block()
            last = master.sync.count + BLOCKED_PERIODS
            bench.until(lambda: master.sync.count >= last)
            bus.release()
            received = master.bus.counters.received
            bench.until(lambda: master.bus.counters.received > received + 20)
        assert bus.waited > 0
        assert len(bus.released_s) <= MAX_AGE_PERIODS * FRAMES_PER_SYNC
