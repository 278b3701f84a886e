"""Bring-up of all nodes in parallel, from identification to operational."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

from robotd.api import ConnectError, OperationError, RobotdError, get_logger
from robotd_canopen.axis import Axis
from robotd_canopen.layout import NetworkLayout
from robotd_canopen.modes import needed_modes
from robotd_canopen.node import Node

log = get_logger("canopen")

_HALT_RAMP, _QUICK_STOP_STAYS, _FAULT_ON_LOSS = 1, 6, 1  # 0x605D, 0x605A, 0x6007


class BringUp:
    """The steps from a bus with power to operational nodes. Worker threads.

    Args:
        bus_name: for error paths.
        allow_partial: go on without the nodes that fail, unless all do.
    """

    def __init__(
        self,
        layout: NetworkLayout,
        axes: Sequence[Axis],
        bus_name: str,
        *,
        allow_partial: bool,
    ) -> None:
        self._layout, self._axes = layout, axes
        self._bus_name, self._allow_partial = bus_name, allow_partial
        self._count = len(layout.node_ids)

    def identify(self, nodes: Iterable[Node]) -> None:
        """Read the identity of every node. Raises ConnectError with every node that fails."""
        self._each(nodes, "the nodes do not answer as expected", Node.identify)

    def start(self, nodes: Iterable[Node]) -> None:
        """Configure and start the nodes. Raises ConnectError with every node that fails."""
        self._each(nodes, "the nodes do not start", self._start)

    def _each(self, nodes: Iterable[Node], message: str, step: Callable[[Node], None]) -> None:
        work = list(nodes)
        failures: dict[str, str] = {}

        def attempt(node: Node) -> None:
            try:
                step(node)
                node.fault = ""
            except Exception as error:  # noqa: BLE001 - a node that fails is one of several
                known = isinstance(error, RobotdError)
                node.fault = str(error) if known else f"{type(error).__name__}: {error}"
                failures[f"canopen → {self._bus_name} → {node.name}"] = node.fault

        if work:
            with ThreadPoolExecutor(len(work), thread_name_prefix="canopen-start") as pool:
                list(pool.map(attempt, work))
        if not failures:
            return
        if not self._allow_partial or len(failures) == self._count:
            raise ConnectError(message, failures)
        for path, reason in failures.items():
            log.warning("node skipped", node=path, reason=reason)

    def _start(self, node: Node) -> None:
        if not node.identity or node.fault:
            node.identify()
        node.configure(self._layout.pdos(node.id))
        for axis in self._axes:
            if axis.node is node:
                self._prepare(axis)
        node.start()

    def _prepare(self, axis: Axis) -> None:
        """Check the supported modes and write the option codes. Nothing moves."""
        layout, options, sdo = axis.layout, axis.layout.options, axis.node.sdo
        supported = sdo.read(layout.index(0x6502))
        for mode, what in needed_modes(options).items():
            if not supported & mode.support_bit:
                raise OperationError(
                    f"modes: {what} needs {mode.name.lower()}, which object 0x6502"
                    f" (0x{supported:08X}) does not offer"
                )
        quick = axis.scaling.ramp_units(options.quick_stop_deceleration_rad_s2)
        value, exponent = _interpolation_period(self._layout.sync_period_s)
        for index, sub, number in (
            (0x6007, 0, _FAULT_ON_LOSS),
            (0x605A, 0, _QUICK_STOP_STAYS),
            (0x605D, 0, _HALT_RAMP),
            (0x6085, 0, quick),
            (0x60C2, 1, value),
            (0x60C2, 2, exponent),
        ):
            if layout.index(index) in sdo.dictionary:
                sdo.write(layout.index(index), sub, number)
        axis.forget()


def _interpolation_period(period_s: float) -> tuple[int, int]:
    """Return object 0x60C2, value (1 byte) and power of ten, as exactly as they allow."""
    for exponent in range(-6, 1):
        value = period_s / 10.0**exponent
        if value <= 255 and math.isclose(value, round(value), rel_tol=1e-6):
            return round(value), exponent
    return max(1, min(255, round(period_s * 1000))), -3
