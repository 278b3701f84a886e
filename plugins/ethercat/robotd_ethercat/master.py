"""EtherCAT master: slaves and axes of one bus, exchanged in step with the control loop."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectionState,
    ProcessImage,
    RobotdError,
    RobotDescriptor,
)
from robotd_cia402.axes import Cia402Master, name_and_scaling
from robotd_cia402.axis import Axis
from robotd_cia402.forced_off import switch_off_by_sdo
from robotd_cia402.guiding import make_guiding
from robotd_cia402.sync_timing import SyncTiming
from robotd_ethercat.bring_up import BringUp
from robotd_ethercat.clock_observer import ClockObserver
from robotd_ethercat.ethercat_drive import EthercatDrive
from robotd_ethercat.exchange import Exchange
from robotd_ethercat.io_image import IoImage
from robotd_ethercat.options import AxisOptions, Clocks, SlaveOptions
from robotd_ethercat.plan import BusPlan
from robotd_ethercat.slave import Slave
from robotd_ethercat.slaves_process import SlavesProcess
from robotd_ethercat.soem import Soem
from robotd_ethercat.supervision import Supervision

_PROBE = 16  # while no frame comes back, one is sent in each n-th period
_AWAIT_SHARE = 0.25  # of a period, for the frame to come back
_BRING_UP_FRAME_S = 0.05  # for one frame; patient, for nothing moves
_LIVE_FRAME_S = 0.002  # while the control loop runs: a call may hold the interpreter lock so long


class Master(Cia402Master[EthercatDrive]):
    """State shared by the drivers of one bus.

    Attributes:
        plan, options: as planned and given.
        bus: SOEM.
        slaves: by their place on the cable.
        io, exchange, supervision, observer, bring_up: the parts.
        jitter_ns: largest deviation of the distance of two frames from the period.
    """

    def __init__(self, robot: RobotDescriptor, plan: BusPlan, bus: Soem, clock: Clock) -> None:
        self.plan, self.options, self.bus, self.bus_name = plan, plan.options, bus, plan.bus_name
        super().__init__(clock, plan.period_s, plan.options.stream_timeout_s)
        self._period_ns = round(plan.period_s * NANOSECONDS)
        self.slaves = {
            number: self._make_slave(robot, number, options)
            for number, options in plan.slaves.items()
        }
        slaves = list(self.slaves.values())
        self.io = IoImage(slaves)
        self.exchange = Exchange(bus, slaves, self.io, clock)
        for axis in plan.axes:
            drive = EthercatDrive(self.slaves[axis.slave], axis.axis_offset, self.exchange)
            self._add_axis(axis, drive, name_and_scaling(robot, axis)[1])
        self.guiding = make_guiding(robot, self.axes)
        limit = self.options.max_lost_frames
        self.supervision = Supervision(bus, slaves, self.axes, self.exchange, self.io, limit)
        self.bring_up = BringUp(plan, bus, slaves, self.axes, self.exchange, clock)
        shift_ns = round(self.options.sync0_shift_s * NANOSECONDS)
        self.observer = ClockObserver(self._period_ns, shift_ns)
        self.timing = SyncTiming(self._period_ns)
        self.jitter_ns = 0
        self._await_s = _AWAIT_SHARE * plan.period_s
        self._live = threading.Lock()
        self._state = ConnectionState.IDLE
        self._identified = False
        self._alarms = 0

    @property
    def state(self) -> ConnectionState:
        """UNKNOWN while a slave is lost or frames do not come back."""
        if self._state is not ConnectionState.COMMUNICATING:
            return self._state
        lost = self.supervision.lost or self.supervision.is_silent
        return ConnectionState.UNKNOWN if lost else self._state

    def fault(self) -> str:
        return self.supervision.fault() if self.state is ConnectionState.UNKNOWN else ""

    def summary(self) -> str:
        found, slaves = len(self.bus.slaves), self.slaves.values()
        drives = sum(slave.is_drive for slave in slaves)
        missing = [slave.name for slave in slaves if slave.number >= found or slave.fault]
        lost = f"; no answer from {', '.join(missing)}" if missing else ""
        return (
            f"EtherCAT on {self.bus_name}: {found} slaves, {drives} configured drives,"
            f" {len(self.slaves) - drives} I/O modules{lost}"
        )

    def open(self) -> None:
        """Open the interface and compare the slaves. Raises ConnectError."""
        self.bus.open(*self.interfaces)
        self.bus.set_frame_timeout(_BRING_UP_FRAME_S)
        try:
            self.bring_up.identify()
        except RobotdError:
            self.bus.close()
            raise
        self._identified = True
        self._state = ConnectionState.RUNNING

    @property
    def interfaces(self) -> tuple[str, str | None]:
        """Interface of the bus, and that at the other end of the cable."""
        options = self.options
        if options.interface is not None and not options.simulated:
            return options.interface, options.redundant_interface
        first, second = SlavesProcess.interface, SlavesProcess.redundant_interface
        return first, second if options.redundant_interface else None

    def close(self) -> None:
        """Leave the bus; the slaves go to their safe state by their watchdogs."""
        self._leave(ConnectionState.IDLE)
        self.bus.close()

    def start(self, timeout_s: float) -> None:
        """Bring all slaves to Op; servos are off. Raises ConnectError.

        After a loss the whole bus starts again: a slave that was reset has no configuration.
        """
        self._leave(ConnectionState.RUNNING)
        if not self._identified:
            self.bring_up.identify()
        self._identified = False
        self.bring_up.start(timeout_s)
        self.bus.set_frame_timeout(_LIVE_FRAME_S)
        self.observer.begin()
        self.timing.begin()
        self._state = ConnectionState.COMMUNICATING
        self.supervision.begin()

    def end(self) -> None:
        """Bring all slaves to PreOp: communication stops."""
        was_running = self._state is ConnectionState.COMMUNICATING
        self._leave(ConnectionState.RUNNING)
        if was_running:
            self.bring_up.stop()

    def force_off(self, axes: Sequence[Axis[EthercatDrive]]) -> None:
        """Slaves that answer are in PreOp, where the mailbox takes the controlword."""
        for axis in axes:
            switch_off_by_sdo(axis, self.clock)

    def read(self, image: ProcessImage) -> None:
        """Control loop: exchange the frame of this period, supervise, fill the image.

        A lost slave is no error here: its axes are offline in ``image``, with the reason.
        """
        with self._live:
            if self._state is ConnectionState.COMMUNICATING:
                self._read(image)
            else:
                image.offline[:] = True

    def _read(self, image: ProcessImage) -> None:
        self._cycles += 1
        if not self.supervision.is_dead or self._cycles % _PROBE == 0:
            # The frame of this period goes first, so that it is punctual, and is awaited. One that
            # is not back in time is received in the next period, and lost if it is not there.
            # After a loss each has that long: what comes back first may be a late one.
            if self.exchange.in_flight:
                self._receive(image)
            self._transmit()
            is_awaited = self.exchange.in_flight and not self.exchange.suspect
            if is_awaited and self.bus.await_process_data(self._await_s):
                self._receive(image)
        if problem := self.stream_problem(self.clock.now_ns()):
            self.supervision.stop(problem)
        for axis in self.axes:
            axis.observe(image)
        self.guide(self.plan.period_s)
        alarms = sum([axis.report.in_alarm for axis in self.axes])
        if alarms > self._alarms:
            self.supervision.note_alarm()
        self._alarms = alarms

    def _receive(self, image: ProcessImage) -> None:
        if not self.exchange.receive():
            self.supervision.note_bad_frame()
            return
        image.fresh_ns = self.timing.time_ns
        if self.bring_up.clocks:
            self.observer.observe(self.bus.bus_time_ns, self.exchange.sent_ns)
            if self.options.clocks is Clocks.SYNC0:
                image.shift_ns = self.observer.shift_ns

    def _transmit(self) -> None:
        """Compute the outputs of all axes and send the frame of this period.

        While the interface is blocked none is sent, and the period counts as one with a lost frame.
        After a stall it waits for up to a fifth of a period, for a time at which the drives count
        the missed periods as this master does: their profiles have advanced by as many.
        """
        self.clock.sleep_until_ns(self.timing.clear_ns(self.clock.now_ns()))
        periods, before_ns = self.timing.periods_at(self.clock.now_ns()), self.exchange.sent_ns
        is_blocked = self.exchange.check_blocked()
        for axis in self.axes:
            axis.transmit(self.plan.period_s, periods)
        if is_blocked:
            self.supervision.note_bad_frame()
            self.timing.note_event(self.clock.now_ns())
            return
        self.exchange.send()
        sent_ns = self.exchange.sent_ns
        if before_ns and self.timing.time_ns:
            self.jitter_ns = max(self.jitter_ns, abs(sent_ns - before_ns - self._period_ns))
        self.timing.note_event(sent_ns)

    def _leave(self, state: ConnectionState) -> None:
        with self._live:  # the control loop is in no exchange from now on
            self._state = state
        self.supervision.end()
        self.bus.set_frame_timeout(_BRING_UP_FRAME_S)
        for slave in self.slaves.values():
            slave.online, slave.fault = False, ""

    def _make_slave(
        self, robot: RobotDescriptor, number: int, options: list[SlaveOptions]
    ) -> Slave:
        first = options[0]
        what = name_and_scaling(robot, first)[0] if isinstance(first, AxisOptions) else "I/O module"
        return Slave(self.bus, number, what, options, self.emergencies, self.clock)
