"""Last means to switch off drives that have not confirmed it: SDO, then a reset of the node."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from robotd.api import Clock, get_logger, wait_until
from robotd_canopen.canopen_drive import CanopenDrive
from robotd_canopen.node import NmtCommand, Node
from robotd_cia402.axis import Axis
from robotd_cia402.forced_off import switch_off_by_sdo

log = get_logger("canopen")

_BOOT_TIMEOUT_S = 2.0  # for the boot-up message after a reset


def force_off(axes: Sequence[Axis[CanopenDrive]], clock: Clock) -> None:
    """Switch the drives off, all nodes at once, and note which confirm it. Worker.

    A node that is stopped answers no SDO and one that is not operational takes no PDOs: both take
    SDO when they are pre-operational.
    """
    nodes: dict[int, list[Axis[CanopenDrive]]] = {}
    for axis in axes:
        nodes.setdefault(axis.drive.node.number, []).append(axis)

    def switch_off(drives: list[Axis[CanopenDrive]]) -> None:
        node = drives[0].drive.node
        try:
            node.command(NmtCommand.PRE_OPERATIONAL)
            confirmed = [switch_off_by_sdo(axis, clock) for axis in drives]
            if all(confirmed) or not _reset(node, clock):
                return
            for axis in drives:
                switch_off_by_sdo(axis, clock)
        except Exception as error:  # noqa: BLE001 - of a bus that is lost; the axes stay unconfirmed
            log.warning("switching off by SDO failed", node=node.name, reason=str(error))

    with ThreadPoolExecutor(len(nodes), thread_name_prefix="canopen-off") as pool:
        list(pool.map(switch_off, nodes.values()))


def _reset(node: Node, clock: Clock) -> bool:
    """Reset a node, and return whether it has booted since."""
    log.warning("the drive does not confirm that it is off: its node is reset", node=node.name)
    sent_ns = clock.now_ns()
    node.command(NmtCommand.RESET_NODE)
    return wait_until(lambda: node.boot_ns > sent_ns, _BOOT_TIMEOUT_S, clock)
