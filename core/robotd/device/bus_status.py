"""Status of a fieldbus and its nodes, independent of the kind of bus."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum


class BusState(Enum):
    """Neutral state of a bus or of a node."""

    UNKNOWN = "unknown"  # not reported, or the bus has no states
    INITIALISING = "initialising"
    CONFIGURABLE = "configurable"  # parameters can be exchanged, process data cannot
    INPUTS_ONLY = "inputs only"  # inputs are valid, outputs are in their safe state
    OPERATIONAL = "operational"
    UPDATING = "updating"  # a boot loader is running


@dataclass(frozen=True)
class BusNode:
    """One device on a fieldbus.

    Attributes:
        id: number by which clients name it, unique on its bus.
        state: ``BusState``.
        error_code: the node's own error number, 0 without one.
        position, address: place on the bus from 0, and configured address.
        offline: it does not answer.
        vendor_id, product_code, revision, serial: identity, 0 where it is not known.
        input_size, output_size: process data, bytes.
        axes: number of axes that it drives, 0 for an I/O module.
        fault: fault in words; "" without one.
        extra: further numbers, by names that only a reader of this kind of bus knows.
    """

    id: int
    state: BusState
    error_code: int = 0
    position: int = 0
    address: int = 0
    offline: bool = False
    vendor_id: int = 0
    product_code: int = 0
    revision: int = 0
    serial: int = 0
    input_size: int = 0
    output_size: int = 0
    axes: int = 0
    fault: str = ""
    extra: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class BusStatus:
    """One fieldbus and its nodes.

    Attributes:
        state: ``BusState``.
        period_s: of the cyclic exchange, seconds; 0 where there is none.
        axes: number of axes on the bus.
        input_size, output_size: process data, bytes.
        lost_frames, timeouts, late_cycles: counters since the start or ``reset_statistics``.
            ``late_cycles`` counts late exchanges: "over cycle" in ``/diagnostics``.
        nodes: ``BusNode``, in the order of the bus.
        note: a sentence for people about what the backend cannot fill in; "" without one.
        details: for ``/diagnostics``: name, with its unit, and value.
        extra: further numbers, by names that only a reader of this kind of bus knows.
    """

    state: BusState
    period_s: float = 0.0
    axes: int = 0
    input_size: int = 0
    output_size: int = 0
    lost_frames: int = 0
    timeouts: int = 0
    late_cycles: int = 0
    nodes: tuple[BusNode, ...] = ()
    note: str = ""
    details: Mapping[str, str] = field(default_factory=dict)
    extra: Mapping[str, int] = field(default_factory=dict)
