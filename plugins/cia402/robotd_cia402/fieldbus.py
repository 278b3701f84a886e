"""Diagnostics that every fieldbus with CiA 402 drives has."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Generic, TypeVar

from robotd.api import BusNode, BusState, ConnectionState, FieldbusDriver
from robotd_cia402.axes import Cia402Master
from robotd_cia402.node import IDENTITY, FieldbusNode

MasterT = TypeVar("MasterT", bound=Cia402Master[Any])

BUS_STATES = {
    ConnectionState.IDLE: BusState.INITIALISING,
    ConnectionState.RUNNING: BusState.CONFIGURABLE,
    ConnectionState.COMMUNICATING: BusState.OPERATIONAL,
    ConnectionState.UNKNOWN: BusState.OPERATIONAL,
    ConnectionState.SHUTDOWN: BusState.INITIALISING,
}


class Cia402Fieldbus(FieldbusDriver, Generic[MasterT]):
    """One bus, number 0."""

    def __init__(self, master: MasterT) -> None:
        self._master = master

    @property
    @abstractmethod
    def nodes(self) -> Mapping[int, FieldbusNode]:
        """By number, in the order of the bus."""

    @abstractmethod
    def _upload(self, node: int, index: int, sub: int) -> bytes:
        """Read an object, raw. Raises SdoAbort, DeviceTimeout, OperationError."""

    @abstractmethod
    def _download(self, node: int, index: int, sub: int, data: bytes) -> None:
        """Write an object once, raw. Raises as ``_upload``."""

    @property
    def buses(self) -> int:
        return 1

    def node_ids(self, bus: int) -> Sequence[int]:
        return list(self.nodes)

    def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
        return self._upload(node, index, subindex)

    def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
        try:
            self._download(node, index, subindex, data)
        finally:  # a write without an answer may have been executed
            for axis in self._master.axes:
                if axis.drive.node.number == node:
                    axis.drive.forget_written()

    def _node(self, node: FieldbusNode, state: BusState, fault: str, **more: Any) -> BusNode:
        """Return the status of a node; ``fault`` where it is online and has no emergency."""
        emergency = node.emergency
        more |= zip(IDENTITY, node.identity, strict=False)
        return BusNode(
            id=node.number,
            state=state,
            offline=not node.online,
            axes=sum(axis.drive.node is node for axis in self._master.axes),
            fault=node.fault or (emergency.text if emergency is not None else "") or fault,
            **more,
        )
