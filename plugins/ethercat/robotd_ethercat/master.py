"""EtherCAT master: slaves and axes of one bus, exchanged in step with the control loop."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectionState,
    LateSetpoint,
    ProcessImage,
    RobotdError,
    RobotDescriptor,
    wait_until,
)
from robotd_cia402.axis import Axis
from robotd_cia402.emcy import EmergencyLog
from robotd_cia402.scaling import Scaling
from robotd_cia402.stream_timeout import StreamTimeout
from robotd_cia402.sync_timing import SyncTiming
from robotd_ethercat.bring_up import BringUp
from robotd_ethercat.clocks import ClockObserver
from robotd_ethercat.exchange import Exchange
from robotd_ethercat.io_image import IoImage
from robotd_ethercat.options import Clocks
from robotd_ethercat.plan import BusPlan
from robotd_ethercat.slave import Slave
from robotd_ethercat.slave_objects import SlaveObjects
from robotd_ethercat.slaves_process import SlavesProcess
from robotd_ethercat.soem import Soem
from robotd_ethercat.supervision import Supervision

_PROBE = 16  # while no frame comes back, one is sent in each n-th period
_SETTLE_PERIODS = 10
_AWAIT_SHARE = 0.25  # of a period, for the frame to come back
_BRING_UP_FRAME_S = 0.05  # for one frame; patient, for nothing moves
_LIVE_FRAME_S = 0.002  # while the control loop runs: a call may hold the interpreter lock so long


class Master:
    """State shared by the four drivers.

    Attributes:
        plan, options, clock: as planned and given.
        bus: SOEM.
        slaves: by their place on the cable.
        axes, drives: by axis number; axes, and axes with their slaves.
        io, exchange, supervision, observer, emergencies, bring_up: the parts.
        jitter_ns: largest deviation of the distance of two frames from the period.
    """

    def __init__(self, robot: RobotDescriptor, plan: BusPlan, bus: Soem, clock: Clock) -> None:
        self.plan, self.options, self.bus, self.clock = plan, plan.options, bus, clock
        self.emergencies = EmergencyLog()
        self.slaves = self._make_slaves(robot)
        self.io = IoImage(list(self.slaves.values()))
        slaves = list(self.slaves.values())
        self.exchange = Exchange(bus, slaves, self.io, clock)
        drives = self._make_axes(robot)
        self.drives = [(axis, slave) for axis, _, slave in drives]
        self.axes = [axis for axis, _ in self.drives]
        self.supervision = Supervision(
            bus,
            slaves,
            self.drives,
            self.exchange,
            self.io,
            self.options.max_lost_frames,
        )
        self.bring_up = BringUp(plan, bus, slaves, drives, self.exchange, clock)
        self._period_ns = round(plan.period_s * NANOSECONDS)
        self._await_s = _AWAIT_SHARE * plan.period_s
        shift_ns = round(self.options.sync0_shift_s * NANOSECONDS)
        self.observer = ClockObserver(self._period_ns, shift_ns)
        self.jitter_ns = 0
        self._timing = SyncTiming(self._period_ns)
        self._live = threading.Lock()
        self._state = ConnectionState.IDLE
        self._identified = False
        self._cycles = self._alarms = 0
        self._stream = StreamTimeout(clock, self.options.stream_timeout_s)

    @property
    def state(self) -> ConnectionState:
        """UNKNOWN while a slave is lost or frames do not come back."""
        if self._state is not ConnectionState.COMMUNICATING:
            return self._state
        lost = self.supervision.lost or self.supervision.is_silent
        return ConnectionState.UNKNOWN if lost else self._state

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

    def start(self) -> None:
        """Bring all slaves to Op; servos are off. Raises ConnectError.

        After a loss the whole bus starts again: a slave that was reset has no configuration.
        """
        self._leave(ConnectionState.RUNNING)
        if not self._identified:
            self.bring_up.identify()
        self._identified = False
        self.bring_up.start()
        self.bus.set_frame_timeout(_LIVE_FRAME_S)
        self.observer.begin()
        self._timing.begin()
        self._state = ConnectionState.COMMUNICATING
        self.supervision.begin()

    def end(self) -> None:
        """Bring all slaves to PreOp: communication stops."""
        was_running = self._state is ConnectionState.COMMUNICATING
        self._leave(ConnectionState.RUNNING)
        if was_running:
            self.bring_up.stop()

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
            self._exchange_frame(image)
        streaming = (slave.name for axis, slave in self.drives if axis.activity.streaming)
        if problem := self._stream.problem(self.clock.now_ns(), streaming):
            self.supervision.stop(problem)
        for axis in self.axes:
            axis.observe(image)
        alarms = sum([axis.report.in_alarm for axis in self.axes])
        if alarms > self._alarms:
            self.supervision.note_alarm()
        self._alarms = alarms

    def stream(self, position: Sequence[float], velocity: Sequence[float], due_ns: int) -> None:
        """Control loop: take setpoints for the axes that stream; the next frame carries them.

        Raises LateSetpoint when they are from before a stall, and the frame of this period came
        after it: they would move drives that have come to rest by the way of one period, and stop
        them again.
        """
        now_ns = self._stream.restart()
        if self._timing.after_rest and now_ns > due_ns:
            raise LateSetpoint
        for axis in self.axes:
            if axis.activity.streaming:
                axis.follow(position[axis.number], velocity[axis.number])

    def stream_torque(self, torque: Sequence[float]) -> None:
        """Control loop: take torques; the next frame carries them."""
        self._stream.restart()
        for axis in self.axes:
            axis.follow_torque(torque[axis.number])

    def begin_stream(self) -> None:
        """Start the time-out of the stream."""
        self._stream.restart()

    def settle(self) -> None:
        """Worker: wait until the image shows the latest change.

        Returns after 10 periods where no control loop runs.
        """
        seen, period_s = self._cycles, self.plan.period_s
        wait_until(
            lambda: self._cycles > seen + 2, _SETTLE_PERIODS * period_s, self.clock, period_s / 4
        )

    def _exchange_frame(self, image: ProcessImage) -> None:
        """Send the frame of this period first, so that it is punctual, and await it.

        One that is not back in time is received in the next period, and lost if it is not there.
        After a loss each has that long: what comes back first may be a late one.
        """
        if self.exchange.in_flight:
            self._receive(image)
        self._transmit()
        if not self.exchange.suspect and self.bus.await_process_data(self._await_s):
            self._receive(image)

    def _receive(self, image: ProcessImage) -> None:
        if not self.exchange.receive():
            self.supervision.note_bad_frame()
            return
        image.fresh_ns = self._timing.time_ns
        if self.bring_up.clocks:
            self.observer.observe(self.bus.bus_time_ns, self.exchange.sent_ns)
            if self.options.clocks is Clocks.SYNC0:
                image.shift_ns = self.observer.shift_ns

    def _transmit(self) -> None:
        """Compute the outputs of all axes and send the frame of this period.

        After a stall it waits for up to a fifth of a period, for a time at which the drives count
        the missed periods as this master does: their profiles have advanced by as many.
        """
        self.clock.sleep_until_ns(self._timing.clear_ns(self.clock.now_ns()))
        periods, before_ns = self._timing.periods_at(self.clock.now_ns()), self.exchange.sent_ns
        for axis in self.axes:
            axis.transmit(self.plan.period_s, periods)
        self.exchange.send()
        sent_ns = self.exchange.sent_ns
        if before_ns and self._timing.time_ns:
            self.jitter_ns = max(self.jitter_ns, abs(sent_ns - before_ns - self._period_ns))
        self._timing.note_event(sent_ns)

    def _leave(self, state: ConnectionState) -> None:
        with self._live:  # the control loop is in no exchange from now on
            self._state = state
        self.supervision.end()
        self.bus.set_frame_timeout(_BRING_UP_FRAME_S)
        for slave in self.slaves.values():
            slave.online, slave.fault = False, ""

    def _make_slaves(self, robot: RobotDescriptor) -> dict[int, Slave]:
        names = {joint.axis: joint.name for joint in robot.joints}
        slaves = {}
        for number, options in self.plan.slaves.items():
            axis = getattr(options[0], "axis", None)
            name = "I/O module" if axis is None else names.get(axis, f"axis {axis}")
            slaves[number] = Slave(self.bus, number, name, options, self.emergencies, self.clock)
        return slaves

    def _make_axes(self, robot: RobotDescriptor) -> list[tuple[Axis, SlaveObjects, Slave]]:
        joints = {joint.axis: joint for joint in robot.joints}
        axes = []
        for options in self.plan.axes:
            slave = self.slaves[options.slave]
            joint = joints.get(options.axis)
            known = (joint.rated_effort, joint.velocity) if joint else (None, None)
            objects = SlaveObjects(slave, options.axis_offset, self.exchange)
            axis = Axis(options.axis, options, objects, Scaling(options, *known))
            axes.append((axis, objects, slave))
        return axes
