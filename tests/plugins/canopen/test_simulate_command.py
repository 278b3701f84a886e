"""The bus of ``robotd canopen simulate``."""

from __future__ import annotations

from typing import Any

import pytest

from robotd_canopen.cli import _simulated_bus
from robotd_canopen.options import BusOptions

OWN = BusOptions(interface="udp_multicast", channel="239.74.163.62", options={"port": 43162})
REAL = BusOptions(interface="socketcan", channel="can0")


@pytest.mark.parametrize(
    ("own", "given", "channel", "options"),
    [
        (OWN, {}, "239.74.163.62", {"port": 43162, "hop_limit": 0}),
        (OWN, {"channel": "239.0.0.1", "port": 5}, "239.0.0.1", {"port": 5, "hop_limit": 0}),
        (REAL, {}, "239.74.163.2", {"port": 43113, "hop_limit": 0}),
        (REAL, {"interface": "socketcan", "channel": "vcan0"}, "vcan0", {}),
        (OWN, {"interface": "virtual", "channel": "x"}, "x", {}),
    ],
)
def test_nodes_are_on_the_multicast_bus_of_the_file_or_on_that_of_the_options(
    own: BusOptions, given: dict[str, Any], channel: str, options: dict[str, int]
) -> None:
    """A real bus of the file is not used unless an option names it."""
    words = {"interface": None, "channel": None} | given
    multicast = {"port": words.pop("port", None), "hop_limit": None}
    bus = _simulated_bus(own, multicast=multicast, **words)
    assert bus.interface == given.get("interface", "udp_multicast")
    assert (bus.channel, dict(bus.options)) == (channel, options)
