"""Device driver of a fieldbus with CiA 402 drives: life cycle, and diagnostics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

from robotd.api import (
    BusNode,
    BusState,
    Clock,
    ConnectionState,
    DeviceDriver,
    FieldbusDriver,
    InvalidArgument,
    NotReady,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd_cia402.axes import Cia402Master
from robotd_cia402.axis import Axis
from robotd_cia402.commands import Commands
from robotd_cia402.node import IDENTITY, FieldbusNode

log = get_logger("cia402")

_FRAMES_OF_RELEASE = 3  # until one of them has carried it, and the next made it effective
_SERVO_TIMEOUT_S = 0.5  # for a stop, and for one servo, while the control loop may not be running
MasterT = TypeVar("MasterT", bound=Cia402Master[Any])

BUS_STATES = {
    ConnectionState.IDLE: BusState.INITIALISING,
    ConnectionState.RUNNING: BusState.CONFIGURABLE,
    ConnectionState.COMMUNICATING: BusState.OPERATIONAL,
    ConnectionState.UNKNOWN: BusState.OPERATIONAL,
    ConnectionState.SHUTDOWN: BusState.INITIALISING,
}


class Simulation(Protocol):
    """Simulated nodes of the robot."""

    def start(self) -> None:
        """Power on; no effect on running nodes. Raises ConnectError."""

    def stop(self) -> None:
        """Power off. Twice is not an error."""

    def inject(self, line: str) -> str:
        """Inject a fault by a line of text; return ``ok`` or a value. Raises ValueError."""


SimulationT = TypeVar("SimulationT", bound=Simulation)


class Cia402Device(DeviceDriver, Generic[MasterT, SimulationT]):
    """Opens, starts and stops the bus. Any worker thread may call.

    Attributes:
        master, fieldbus: drivers of the same bus.
        simulation: simulated nodes of the robot; None on real ones.
    """

    def __init__(
        self, master: MasterT, fieldbus: FieldbusDriver, simulation: SimulationT | None
    ) -> None:
        self.master, self.fieldbus, self.simulation = master, fieldbus, simulation
        self._stops = 0  # number of times that communication was ended

    def open(self, path: str = "", name: str = "") -> None:
        """Open the configured bus; ``path`` may name no other one, ``name`` is not used."""
        bus = self.master.bus_name
        if path and path != bus:
            raise InvalidArgument(f"the bus is {bus!r}, another one ({path!r}) is not configured")
        if self.master.state is not ConnectionState.IDLE:
            return
        if self.simulation is not None:
            self.simulation.start()
        try:
            self.master.open()
        except RobotdError:
            self._end_simulation()
            raise

    def close(self) -> None:
        self._stops += 1
        if self.master.state in (ConnectionState.COMMUNICATING, ConnectionState.UNKNOWN):
            self.stop_communication(_SERVO_TIMEOUT_S)
        self.master.close()
        self._end_simulation()

    def start_communication(self, timeout_s: float) -> None:
        """Bring the nodes into operation; after a fault again, with all servos off.

        Raises ConnectError with every node that fails, its step, and what was found.
        """
        if self.master.state is ConnectionState.IDLE:
            raise NotReady("communication cannot start: the bus is not open")
        if self.master.state is not ConnectionState.COMMUNICATING:
            stops = self._stops
            self.master.start(timeout_s)
            if self._stops != stops:  # by a caller that has given this start up
                self.stop_communication(_SERVO_TIMEOUT_S)
                raise NotReady("communication was stopped while it started")

    def stop_communication(self, timeout_s: float) -> None:
        """Also of nodes that a start which failed for others has started."""
        self._stops += 1
        if self.master.state is ConnectionState.IDLE:
            return
        switch_off(self.master.axes, timeout_s, self.master.clock)
        try:
            self.master.end()
        except RobotdError as error:
            log.warning("stopping the bus failed", reason=str(error))
        if unconfirmed := [axis for axis in self.master.axes if axis.power.may_be_on]:
            self.master.force_off(unconfirmed)

    def state(self) -> ConnectionState:
        return self.master.state

    def fault(self) -> str:
        return self.master.fault()

    def scan_network(self) -> str:
        if self.master.state is ConnectionState.IDLE:
            raise NotReady("the network cannot be scanned: the bus is not open")
        return self.master.summary()

    def _end_simulation(self) -> None:
        if self.simulation is not None:
            self.simulation.stop()


def switch_off(axes: Collection[Axis[Any]], timeout_s: float, clock: Clock) -> None:
    """Stop the axes that are powered, then switch their servos off. Worker.

    Args:
        timeout_s: for all to come to rest; then the servos are switched off in motion.

    A servo that does not go off is logged; the others are switched off all the same. A drive that
    is lost may receive: it is switched off without an answer. ``PowerStage.may_be_on`` of an axis
    says afterwards whether it has confirmed.
    """
    online = [axis for axis in axes if axis.drive.node.online]
    lost = [axis for axis in axes if not axis.drive.node.online and axis.power.may_be_on]
    live = [axis for axis in online if axis.report.powered]
    for axis in live:
        axis.power.may_be_on = True
    for axis in live:
        axis.brake(axis.options.stop_deceleration_rad_s2)
    wait_until(lambda: all(axis.activity.is_idle for axis in live), timeout_s, clock)
    for axis in live:
        Commands(axis, clock).leave_quick_stop()
    for axis in (*online, *lost):
        axis.power.release(axis.report.state)  # of all, before one of them is waited for
    sent = [(axis.drive, axis.drive.frames + _FRAMES_OF_RELEASE) for axis in lost]
    for axis in online:
        try:
            Commands(axis, clock).disable(_SERVO_TIMEOUT_S)
        except RobotdError as error:
            log.warning("switching off failed", axis=axis.number, reason=str(error))
    wait_until(lambda: all(drive.frames >= last for drive, last in sent), _SERVO_TIMEOUT_S, clock)


class Cia402Fieldbus(FieldbusDriver, Generic[MasterT]):
    """One bus, number 0."""

    def __init__(self, master: MasterT) -> None:
        self._master = master

    @property
    @abstractmethod
    def nodes(self) -> Mapping[int, FieldbusNode]:
        """Nodes by number, in the order of the bus."""

    @abstractmethod
    def _upload(self, node: int, index: int, sub: int) -> bytes:
        """Read an object, raw. Raises SdoAbort, DeviceTimeout, OperationError."""

    @abstractmethod
    def _download(self, node: int, index: int, sub: int, data: bytes) -> None:
        """Write an object once, raw. Raises the errors of ``_upload``."""

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
