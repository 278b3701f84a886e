"""Line of slaves: cables between them, frames through them, faults of cables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from random import Random

from robotd_cia402.simulated import Motors
from robotd_ethercat.simulated import registers as reg
from robotd_ethercat.simulated.datagrams import DatagramProcessor
from robotd_ethercat.simulated.servo_drive import ServoDrive
from robotd_ethercat.simulated.simulated_slave import Slave
from robotd_ethercat.simulated.slave_controller import SlaveController

_HOP_NS = 500  # delay from one slave to the next
_SOURCE = 6  # first byte of the source address, of which slaves set bit 1
_PAUSE_NS = 15_000_000  # between two calls of ``tick``; a longer time is a stall of the computer
_PERIOD_S = 0.004  # where nothing defines the period of the outputs
_LOST_NS = 100_000_000  # without outputs for so long the motors run on the computer's clock
_DEFAULT_S = 0.004


class MotionClock:
    """Advances the motors of all drives of a line."""

    def __init__(self, machine: Motors, drives: Sequence[ServoDrive]) -> None:
        self._machine, self._drives = machine, drives
        self._outputs_ns: int | None = None

    def outputs(self, now_ns: int) -> float:
        """Advance by one period of the outputs, more if outputs were lost; return the period."""
        self._outputs_ns = now_ns
        period_s = self._period_s()
        self._machine.synchronise(now_ns, period_s)
        return period_s

    def is_idle(self, now_ns: int) -> bool:
        """Return True if no outputs come, after advancing to ``now_ns``."""
        if self._outputs_ns is not None and now_ns - self._outputs_ns < _LOST_NS:
            return False
        self._machine.free_run(now_ns)
        return True

    def _period_s(self) -> float:
        """Period of the first drive that has one: all drives share the frame."""
        periods = (drive.period_s() for drive in self._drives if drive.powered)
        return next((period for period in periods if period is not None), _DEFAULT_S)


class Port(Enum):
    """Ends of the line at which a master may be connected."""

    PRIMARY = auto()
    SECONDARY = auto()


@dataclass
class Cable:
    """Cable before a slave.

    Attributes:
        cut: no link.
        loss: part of the frames lost, 0 to 1.
        corruption: part of the frames corrupted, 0 to 1.
    """

    cut: bool = False
    loss: float = 0.0
    corruption: float = 0.0


class Line:
    """N slaves in a row; one thread.

    Args:
        slaves: in bus order, from the master's primary port.
        redundant: a second port of the master is connected behind the last slave.
        motion: time of the motors; None without drives.

    Attributes:
        cables: one before each slave, and one to the secondary port.
    """

    def __init__(
        self,
        slaves: Sequence[Slave],
        *,
        redundant: bool = False,
        motion: MotionClock | None = None,
    ) -> None:
        self.slaves = list(slaves)
        self.cables = [Cable() for _ in range(len(self.slaves) + 1)]
        self.cables[-1].cut = not redundant
        self._motion = motion
        self._processor = DatagramProcessor()
        self._random = Random(1)  # noqa: S311 - repeatable, no secret
        self._serviced_ns: int | None = None
        self.buffer = self._processor.buffer
        self.update()

    def update(self) -> None:
        """Take over changed cables and power: links and reachable slaves."""
        linked = [
            not cable.cut and self._powered(n - 1) and self._powered(n)
            for n, cable in enumerate(self.cables)
        ]
        for number, slave in enumerate(self.slaves):
            slave.controller.on_configured = self._processor.logical.clear
            if slave.powered:
                slave.controller.set_links(linked[number], linked[number + 1])
        count = len(self.slaves)
        ahead = next((n for n in range(count) if not linked[n]), count)
        behind = next((n for n in range(count, 0, -1) if not linked[n]), 0)
        self._ring = ahead == count and linked[count]
        for number in range(ahead):
            back = None if number == ahead - 1 and not self._ring else 2 * ahead - 2 - number
            controller = self.slaves[number].controller
            controller.arrival_ns = number * _HOP_NS
            controller.return_ns = None if back is None else back * _HOP_NS
        self._ahead = [slave.controller for slave in self.slaves[:ahead]]
        self._behind = [slave.controller for slave in self.slaves[behind:]]
        self._faulty = any(cable.loss or cable.corruption for cable in self.cables)
        self._processor.logical.clear()

    def power(self, number: int, on: bool, now_ns: int) -> None:
        """Switch a slave off, or on again with the values of power-on."""
        slave = self.slaves[number]
        if slave.powered is not on:
            if on:
                slave.power_on(now_ns)
            else:
                slave.power_off()
            self.update()

    def forward(self, length: int, now_ns: int, port: Port = Port.PRIMARY) -> Port | None:
        """Send the frame in ``buffer`` through the slaves; return where it comes out.

        None: lost on the way. ``service`` must follow.
        """
        slaves = self._ahead
        if port is Port.SECONDARY:
            if self._ring:
                return Port.PRIMARY  # towards the master slaves only repeat a frame
            slaves = self._behind
        elif self._faulty and not self._survives(slaves, length, now_ns):
            return None
        if not slaves and port is Port.PRIMARY:
            return None  # no link
        self._process(slaves, length, now_ns)
        return Port.SECONDARY if port is Port.PRIMARY and self._ring else port

    def service(self, now_ns: int) -> None:
        """Let the slaves act on what the frame brought."""
        active = [slave for slave in self.slaves if slave.powered]
        for slave in active:
            controller = slave.controller
            controller.clock.settle()
            if (
                controller.mailbox_event
                or controller.al_request is not None
                or controller.repeat_request
            ):
                slave.service(now_ns)
        cyclic = [slave for slave in active if slave.controller.output_event]
        if not cyclic:
            return
        motion = self._motion
        period_s = _PERIOD_S if motion is None else motion.outputs(now_ns)
        for slave in active:
            slave.update_inputs(period_s)
        for slave in cyclic:
            if slave.take_outputs(now_ns):
                slave.process_outputs(period_s)
            slave.put_inputs()

    def tick(self, now_ns: int) -> None:
        """Supervise; call it every few milliseconds."""
        before_ns, self._serviced_ns = self._serviced_ns, now_ns
        elapsed_ns = 0 if before_ns is None else now_ns - before_ns
        paused_ns = elapsed_ns if elapsed_ns > _PAUSE_NS else 0
        idle = self._motion is not None and self._motion.is_idle(now_ns)
        for slave in self.slaves:
            if slave.powered:
                slave.tick(now_ns, paused_ns)
                if idle:
                    slave.update_inputs(elapsed_ns * 1e-9)
                    slave.put_inputs()

    def _powered(self, number: int) -> bool:
        return not 0 <= number < len(self.slaves) or self.slaves[number].powered

    def _process(self, slaves: Sequence[SlaveController], length: int, now_ns: int) -> None:
        self._processor.process(slaves, length, now_ns)
        self.buffer[_SOURCE] |= 0x02

    def _survives(self, slaves: Sequence[SlaveController], length: int, now_ns: int) -> bool:
        """Decide the faults of the cables; slaves before a bad cable process the frame."""
        for number in range(len(slaves)):
            cable = self.cables[number]
            if cable.loss and self._random.random() < cable.loss:
                self._process(slaves[:number], length, now_ns)
                return False
            if cable.corruption and self._random.random() < cable.corruption:
                self._process(slaves[:number], length, now_ns)
                _count_corruption(slaves[number:])
                return False
        return True


def _count_corruption(slaves: Sequence[SlaveController]) -> None:
    """Count a corrupted frame: where it was corrupted, and forwarded behind."""
    for number, slave in enumerate(slaves):
        if number == 0:
            slave.count_error(reg.RX_ERRORS)  # invalid frame at port 0
            slave.count_error(reg.RX_ERRORS + 1)
        else:
            slave.count_error(reg.FORWARDED_ERRORS)
