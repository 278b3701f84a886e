"""The simulated EtherCAT line: one drive per axis, then perhaps an I/O module."""

from __future__ import annotations

from dataclasses import dataclass

from robotd.api import BusNode, BusState, BusStatus, RobotDescriptor
from robotd_sim.alarms import NO_ANSWER
from robotd_sim.options import SimOptions

VENDOR_ID = 0x0000_5349  # unassigned: a made-up identity must not claim a real manufacturer
DRIVE_PRODUCT, MODULE_PRODUCT = 0x0000_0D01, 0x0000_0D10
REVISION = 0x0001_0000
FIRST_ADDRESS = 0x03E9  # station addresses count from 1001, as masters commonly assign them
MODULE_BYTES = 2  # inputs and outputs of the I/O module, at the start of the images
DRIVE_INPUT_BYTES = 4  # digital inputs (0x60FD) of a drive
DRIVE_RX_PDO, DRIVE_TX_PDO = 13, 21  # bytes: commands to a drive, values from it
AL_LOST = 0x001B  # AL status code: sync manager watchdog
_DELAYS_NS = (1840, 1846, 1842, 1851, 1839, 1844, 1848, 1841)  # of a frame, in turn


@dataclass
class Slave:
    """One device on the line; ``axis`` is None for the I/O module.

    ``connected`` it answers; once ``plugged`` again it does so from the next hot connect on.
    """

    id: int
    axis: int | None
    connected: bool = True
    plugged: bool = True

    @property
    def address(self) -> int:
        """Configured station address."""
        return FIRST_ADDRESS + self.id

    def state(self, *, communicating: bool) -> BusState:
        if not self.connected:
            return BusState.UNKNOWN
        return BusState.OPERATIONAL if communicating else BusState.CONFIGURABLE

    def node(self, module_bytes: int, *, communicating: bool) -> BusNode:
        """``module_bytes`` of the images belong to the I/O module; the drives' inputs follow."""
        drive = self.axis is not None
        return BusNode(
            id=self.id,
            state=self.state(communicating=communicating),
            error_code=0 if self.connected else AL_LOST,
            position=self.id,
            address=self.address,
            offline=not self.connected,
            vendor_id=VENDOR_ID,
            product_code=DRIVE_PRODUCT if drive else MODULE_PRODUCT,
            revision=REVISION,
            serial=self.id + 1,
            input_size=DRIVE_INPUT_BYTES if drive else MODULE_BYTES,
            output_size=0 if drive else MODULE_BYTES,
            axes=int(drive),
            fault="" if self.connected else NO_ANSWER,
            extra={
                "input_address": module_bytes + DRIVE_INPUT_BYTES * self.id if drive else 0,
                "output_address": 0,
            },
        )


class Network:
    """Slaves and the master's counters. Hold the world's lock."""

    def __init__(self, robot: RobotDescriptor, options: SimOptions) -> None:
        self.slaves = [Slave(axis, axis) for axis in range(robot.axes)]
        has_module = options.io_module
        if has_module is None:
            has_module = robot.gripper is not None
        if has_module:
            self.slaves.append(Slave(robot.axes, None))
        self._module_bytes = MODULE_BYTES if has_module else 0
        self._axes, self._period_s = robot.axes, options.tick_s
        self.packet_loss = 0
        self.frozen = False  # frames are lost unnoticed
        self._silent_until = 0  # tick
        self._reset_at = 0
        self._slips = 0

    def lose_packets(self, tick: int, count: int) -> None:
        """Lose ``count`` further frames in a row."""
        self._silent_until = max(self._silent_until, tick) + count
        self.packet_loss += count

    def is_silent(self, tick: int) -> bool:
        """Return True while no frame arrives."""
        return self.frozen or tick < self._silent_until

    def up(self, tick: int) -> None:
        """Communication begins: counters start anew."""
        self.frozen = False
        self._silent_until = self._reset_at = tick
        self.packet_loss = 0

    def reset(self, tick: int, slips: int) -> None:
        """Zero the counters."""
        self._reset_at, self._slips, self.packet_loss = tick, slips, 0

    def state(self, tick: int, slips: int, *, communicating: bool) -> BusStatus:
        nodes = tuple(
            slave.node(self._module_bytes, communicating=communicating) for slave in self.slaves
        )
        frames = tick - self._reset_at if communicating else 0
        seen = _DELAYS_NS[: max(0, min(frames, len(_DELAYS_NS)))] or (0,)
        return BusStatus(
            state=BusState.OPERATIONAL if communicating else BusState.CONFIGURABLE,
            period_s=self._period_s,
            axes=self._axes,
            input_size=sum(node.input_size for node in nodes),
            output_size=sum(node.output_size for node in nodes),
            lost_frames=self.packet_loss,
            late_cycles=slips - self._slips,
            nodes=nodes,
            note="simulated network: delays in ns follow a fixed pattern",
            extra={
                "rx_pdo_size": self._axes * DRIVE_RX_PDO + self._module_bytes,
                "tx_pdo_size": self._axes * DRIVE_TX_PDO + self._module_bytes,
                "tx_delay": _DELAYS_NS[frames % len(_DELAYS_NS)] if frames else 0,
                "min_tx_delay": min(seen),
                "max_tx_delay": max(seen),
            },
        )
