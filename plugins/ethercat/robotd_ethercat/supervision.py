"""Supervision of the bus: lost frames in the control loop, lost slaves in a thread."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from robotd.api import DeviceTimeout, RobotdError, get_logger
from robotd_cia402.axis import Axis
from robotd_ethercat.al_status import AlState, al_code_text
from robotd_ethercat.ethercat_drive import EthercatDrive
from robotd_ethercat.exchange import Exchange
from robotd_ethercat.io_image import IoImage
from robotd_ethercat.slave import RESET, Slave
from robotd_ethercat.soem import SlaveState, Soem

log = get_logger("ethercat")

_INCOMPLETE_FRAMES = 3  # in a row, until the AL states are read
_MAX_KEPT_FAULTS = 100  # latest faults
_CHECK_PERIOD_S = 1.0  # between two looks at a bus without a fault
_SEARCH_PERIOD_S = 0.05  # while a slave is lost


class Supervision:
    """Stops all axes when frames or slaves are lost, and takes slaves back.

    The control loop sees that frames are missing; which slave is the cause, only a thread can
    find out that may wait for answers.

    Attributes:
        faults: the latest faults, newest last, as text that names slave and cause.
    """

    def __init__(
        self,
        bus: Soem,
        slaves: Sequence[Slave],
        axes: Sequence[Axis[EthercatDrive]],
        exchange: Exchange,
        io: IoImage,
        max_lost_frames: int,
    ) -> None:
        self.faults: list[str] = []
        self._bus, self._slaves, self._axes = bus, slaves, axes
        self._exchange, self._io, self._limit = exchange, io, max_lost_frames
        self._lock = threading.Lock()
        self._wake, self._ending = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._turn = 0

    @property
    def lost(self) -> list[Slave]:
        """Slaves that were brought up and are lost. Any thread."""
        return [slave for slave in self._slaves if not slave.online]

    @property
    def is_silent(self) -> bool:
        """More frames in a row than allowed are lost or incomplete."""
        return self._exchange.bad_in_row > self._limit

    @property
    def is_incomplete(self) -> bool:
        """Frames return, but the last were not processed by every online slave."""
        exchange = self._exchange
        return exchange.bad_in_row >= _INCOMPLETE_FRAMES and exchange.working_counter > 0

    @property
    def is_dead(self) -> bool:
        """True while no frame comes back; incomplete ones reach the slaves before the loss."""
        return self._exchange.working_counter <= 0 and self.is_silent

    def fault(self) -> str:
        """Return the lost slaves with causes, or the bus fault; "" without one."""
        causes = _by_cause([slave for slave in self.lost if slave.fault])
        if causes:
            return "; ".join(causes)
        return self._frame_fault() if self.is_silent else ""

    def begin(self) -> None:
        """Worker: the bus is in Op; supervise it."""
        # New events: a thread that still waits for a slave's answer ends by its own.
        self._wake, self._ending = threading.Event(), threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(self._wake, self._ending), name="ethercat-watch", daemon=True
        )
        self._thread.start()

    def end(self) -> None:
        """Worker: communication ends."""
        self._ending.set()
        self._wake.set()
        if self._thread is not None:
            self._thread.join(2.0)
            self._thread = None

    def note_bad_frame(self) -> None:
        """Control loop: note a lost or incomplete frame; too many stop all axes.

        Incomplete ones are looked into at once: no stall of this computer is their cause.
        """
        if self._exchange.bad_in_row == self._limit + 1:
            self.stop(self._frame_fault())
            self._wake.set()
        elif self.is_incomplete and self._exchange.bad_in_row == _INCOMPLETE_FRAMES:
            self._wake.set()

    def note_alarm(self) -> None:
        """Control loop: read the AL states soon, a drive reports an alarm.

        It may have left Op, which no working counter shows.
        """
        self._wake.set()

    def stop(self, reason: str) -> None:
        """Stop all axes, each with its own ramp, and remember why. Any thread."""
        log.error("motion stopped", reason=reason)
        self.faults.append(reason)
        del self.faults[:-_MAX_KEPT_FAULTS]
        for axis in self._axes:
            axis.brake(axis.options.stop_deceleration_rad_s2)

    def check(self) -> None:
        """Watch thread: read the AL states; lose slaves and take them back."""
        lost = []
        with self._lock:
            states = self._bus.states()
            for slave in self._slaves:
                found = states[slave.number]
                slave.state, slave.al_code = found.state, found.code if found.error else 0
                if slave.online:
                    if self._has_left(slave, found):
                        self._lose(slave, _cause(found))
                        lost.append(slave)
                else:
                    self._search(slave, found)
            self._exchange.count_online(states)
        for reason in _by_cause(lost):
            self.stop(reason)

    def _has_left(self, slave: Slave, found: SlaveState) -> bool:
        """Return True if an online slave is not in Op, by two answers that agree.

        One answer may be late, or that to another request.
        """
        if not self._shows_loss(found):
            return False
        again = self._bus.state(slave.number)
        return again.state is found.state and self._shows_loss(again)

    def _shows_loss(self, found: SlaveState) -> bool:
        """Return True for a state other than Op.

        That a slave does not answer counts only while frames are bad: a slave that is lost adds
        nothing to their working counter.
        """
        if found.state is AlState.NONE:
            return self.is_silent or self.is_incomplete
        return found.state is not AlState.OP

    def _lose(self, slave: Slave, cause: str) -> None:
        """Mark ``slave`` as lost, and switch it off."""
        slave.online, slave.losses = False, slave.losses + 1
        slave.fault = cause + slave.emergency_text()
        for axis in self._axes:
            if axis.drive.node is slave:
                axis.power.reset()
        self._io.clear(slave)

    def _search(self, slave: Slave, found: SlaveState) -> None:
        """One attempt to bring a lost slave back that has kept its configuration."""
        if found.state is AlState.NONE:
            if self._bus.find_again(slave.number):
                slave.fault = RESET
        elif found.state in (AlState.INIT, AlState.PRE_OP, AlState.BOOT):
            slave.fault = RESET
        elif found.error or found.state is AlState.SAFE_OP:
            acknowledged = AlState.SAFE_OP if found.error else AlState.OP
            self._bus.request(acknowledged, slave.number, acknowledge=found.error)
        else:
            self._take_back(slave)

    def _take_back(self, slave: Slave) -> None:
        """Take back a slave in Op; its axes are off until they are switched on.

        Frames that it has not processed hold its values from before: none counts from now on.
        """
        self._exchange.expect(slave)
        for axis in self._axes:
            if axis.drive.node is slave:
                axis.power.reset()
                axis.drive.forget()
                axis.hold()
        slave.online, slave.fault = True, ""
        log.info("slave is back", slave=slave.name)

    def _frame_fault(self) -> str:
        exchange, count = self._exchange, self._exchange.bad_in_row
        if exchange.blocked:
            return f"the network interface has sent no frame for {count} periods"
        if exchange.working_counter <= 0:
            return f"no frame came back for {count} periods: check the cable of the first slave"
        return (
            f"{count} frames in a row were incomplete: working counter"
            f" {exchange.working_counter}, expected {exchange.needed}"
        )

    def _run(self, wake: threading.Event, ending: threading.Event) -> None:
        while True:
            searching = bool(self.lost) or self.is_silent
            wake.wait(_SEARCH_PERIOD_S if searching else _CHECK_PERIOD_S)
            wake.clear()
            if ending.is_set():
                return
            try:
                self.check()
                self._poll_mailbox()
            except RobotdError as error:
                log.debug("supervision", reason=str(error))
            except Exception:
                log.exception("supervision failed")

    def _poll_mailbox(self) -> None:
        """Fetch emergencies: of drives in alarm, and of one other slave in turn."""
        alarmed = [axis.drive.node for axis in self._axes if axis.report.in_alarm]
        drives = [slave for slave in self._slaves if slave.is_drive]
        self._turn += 1
        for slave in dict.fromkeys((*alarmed, *drives[self._turn % max(1, len(drives)) :][:1])):
            if slave.online:
                try:
                    slave.poll_mailbox()
                except DeviceTimeout:
                    continue


def _by_cause(slaves: Sequence[Slave]) -> list[str]:
    """Return one text for each cause, with the names of its lost slaves."""
    names: dict[str, list[str]] = {}
    for slave in slaves:
        names.setdefault(slave.fault, []).append(slave.name)
    return [f"{', '.join(lost)}: {cause}" for cause, lost in names.items()]


def _cause(found: SlaveState) -> str:
    """Return why a slave that was operational is lost."""
    if found.state is AlState.NONE:
        return "no answer: check its power, and the cable before it"
    text = al_code_text(found.code) if found.error else ""
    return f"it went to {found.state.text} by itself" + (f": {text}" if text else "")
