"""Bring-up of all nodes in parallel, from identification to operational."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

from robotd.api import ConnectError, RobotdError, get_logger
from robotd_canopen.canopen_drive import CanopenDrive
from robotd_canopen.default_pdos import LOST
from robotd_canopen.layout import NetworkLayout
from robotd_canopen.node import Node
from robotd_cia402.axis import Axis
from robotd_cia402.drive_setup import set_up
from robotd_cia402.start_pace import start_limit

log = get_logger("canopen")


class BringUp:
    """The steps from a bus with power to operational nodes. Worker threads.

    Args:
        bus_name: for error paths.
        release: called with each node once: right before it is online, or when it has failed.
        allow_partial: go on without drives that fail, unless all nodes do. Inputs of a module that
            is left out would read as 0.
    """

    def __init__(
        self,
        layout: NetworkLayout,
        axes: Sequence[Axis[CanopenDrive]],
        bus_name: str,
        release: Callable[[Node], None],
        *,
        allow_partial: bool,
    ) -> None:
        self._layout, self._axes, self._release = layout, axes, release
        self._bus_name, self._allow_partial = bus_name, allow_partial
        self._count = len(layout.node_ids)

    def identify(self, nodes: Iterable[Node]) -> None:
        """Read the identity of every node. Raises ConnectError with every node that fails."""
        self._each(nodes, "the nodes do not answer as expected", Node.identify)

    def start(self, nodes: Iterable[Node], timeout_s: float) -> None:
        """Configure and start the nodes. Raises ConnectError with every node that fails.

        Args:
            timeout_s: a node that will not be configured by then fails a little earlier.
        """
        # After it come a transfer, and the check for a duplicate node id.
        limit_s = start_limit(timeout_s, self._layout.options.sdo_timeout_s)

        def start(node: Node) -> None:
            node.sdo.pace.limit(limit_s)
            try:
                self._start(node)
            finally:
                node.sdo.pace.limit()

        self._each(nodes, "the nodes do not start", start)

    def _each(self, nodes: Iterable[Node], message: str, step: Callable[[Node], None]) -> None:
        work = list(nodes)
        failed: list[Node] = []

        def attempt(node: Node) -> None:
            try:
                step(node)
                node.fault = ""
            except Exception as error:  # noqa: BLE001 - a node that fails is one of several
                known = isinstance(error, RobotdError)
                node.fault = str(error) if known else f"{type(error).__name__}: {error}"
                failed.append(node)

        if work:
            with ThreadPoolExecutor(len(work), thread_name_prefix="canopen-start") as pool:
                list(pool.map(attempt, work))
        if not failed:
            return
        failures = {}
        for node in sorted(failed, key=work.index):
            path = f"{self._bus_name} → {node.name}"  # the texts of SDO begin with it, too
            failures[f"canopen → {path}"] = node.fault.replace(f"{path}: ", "")
        drives = {axis.drive.node for axis in self._axes}
        partial = self._allow_partial and len(failed) < self._count and drives.issuperset(failed)
        if not partial:
            raise ConnectError(message, failures)
        for path, reason in failures.items():
            log.warning("node skipped", node=path, reason=reason)
        for node in failed:
            self._release(node)

    def _start(self, node: Node) -> None:
        if not node.identity or node.fault:
            node.identify()
        axes = [axis for axis in self._axes if axis.drive.node is node]
        self._report_left_out(node, axes)
        with node.require_unique_id():
            node.configure(self._layout.pdos(node.number))
            for axis in axes:
                set_up(axis, self._layout.sync_period_s)
                axis.drive.accept()
            node.start()
            for axis in axes:
                axis.drive.query()
        self._release(node)
        node.enter()

    def _report_left_out(self, node: Node, axes: Sequence[Axis[CanopenDrive]]) -> None:
        """Log once what is lost without objects that the default PDOs do not hold."""
        effects = [
            f"0x{axis.drive.layout.index(base):04X}: {LOST[base]}"
            for axis in axes
            for base in axis.drive.layout.left_out
            if axis.drive.is_news(base)
        ]
        if effects:
            log.warning("objects not in the default PDOs", node=node.name, effects=effects)
