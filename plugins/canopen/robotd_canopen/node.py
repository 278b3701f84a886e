"""One node, seen from the master: heartbeat, emergencies and bring-up."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from enum import IntEnum

from canopen.objectdictionary import ObjectDictionary

from robotd.api import NANOSECONDS, Clock, OperationError, RobotdError, get_logger, wait_until
from robotd_canopen.bus import Bus
from robotd_canopen.object_dictionary import DcfValue, dcf_values, startup_writes, variable
from robotd_canopen.options import AxisOptions, CanopenOptions, NodeOptions
from robotd_canopen.pdo import Pdo, configure, disable_others
from robotd_canopen.sdo import Sdo
from robotd_cia402.code_tables import error_text, register_text
from robotd_cia402.drive_access import SdoAbort
from robotd_cia402.node import IDENTITY, Emergency, FieldbusNode

log = get_logger("canopen")

_EMCY, _HEARTBEAT = 0x080, 0x700
_POLL_S = 0.002
_GUARD_S = 0.02  # between two requests for the state of a node without heartbeats
_START_TIMEOUT_S = 2.0  # for the first heartbeat in state OPERATIONAL
_CONSUMER = 0x1016
RESET = "it was reset and has lost its configuration; start communication again"
"""Cause of the loss of a node that has booted by itself."""
MISSED = "it may have sent event-driven PDOs while it was lost; start communication again"
"""Reason for a node that answers again and whose values may be old."""
ANSWERS = "duplicate node id: received more SDO responses than requests"
FRAMES = "duplicate node id: {} comes more often than SYNC"
HEARTBEATS = "heartbeats come more than once in each period: probably a duplicate node id"
_WINDOW = 20  # heartbeat periods in which heartbeats are counted
_MAX_RATE = 1.6  # heartbeats for each period; above half of twice as many, below twice as many
_WINDOWS = 2  # in a row: after a stall of this computer, waiting ones come in one of them


class NmtState(IntEnum):
    """States as a heartbeat reports them (CiA 301, 7.2.8.3.2)."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127
    UNKNOWN = 255  # never sent: no heartbeat has been received


class NmtCommand(IntEnum):
    """Commands of the NMT master (CiA 301, 7.2.8.3.1)."""

    START = 1
    STOP = 2
    PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


def heartbeat_state(data: bytes | bytearray) -> NmtState:
    """State in a heartbeat frame, toggle bit ignored. Raises ValueError for anything else."""
    if len(data) != 1:
        raise ValueError(f"a heartbeat has 1 byte, this one {len(data)}")
    return NmtState(data[0] & 0x7F)


class HeartbeatRate:
    """Finds nodes whose heartbeats come twice as often as they say. Control loop.

    Attributes:
        period_s: as the node reports it (object 0x1017); 0: not known, nothing is found.
    """

    def __init__(self) -> None:
        self.period_s = 0.0
        self._begun_ns = self._count = self._windows = 0

    def is_doubled(self, count: int, now_ns: int) -> bool:
        """Return True while too many of ``count`` heartbeats, since power-on, have come lately."""
        elapsed_s = (now_ns - self._begun_ns) / NANOSECONDS
        if not self.period_s or elapsed_s < _WINDOW * self.period_s:
            return self._windows >= _WINDOWS
        fast = count - self._count > _MAX_RATE * elapsed_s / self.period_s
        self._windows = self._windows + 1 if fast and self._begun_ns else 0
        self._begun_ns, self._count = now_ns, count
        return self._windows >= _WINDOWS


class Node(FieldbusNode):
    """A drive or an I/O module; its number is the node id.

    Attributes:
        state: NMT state of its last heartbeat.
        configured: it has been brought up and has not been reset since.
        boot_ns: time of its latest boot-up message; 0 before the first.
        dcf_values: values of its DCF that are written while it starts, before ``startup``.
        startup: objects and values that are written while it starts.
    """

    def __init__(
        self,
        bus: Bus,
        options: NodeOptions,
        what: str,
        profile: int,
        dictionary: ObjectDictionary,
        common: CanopenOptions,
        emergencies: deque[Emergency],
        clock: Clock,
    ) -> None:
        super().__init__("node", options.node, what, emergencies)
        self.state = NmtState.UNKNOWN
        self.lost_heartbeats = 0
        self.configured = False
        self.dcf_values = self._dcf_values(options, dictionary)
        self.startup = startup_writes(options)
        self._skipped = set(options.skip_writes)
        self._supervision_reported = False
        self.unwatched = self._unwatched(dictionary)
        self._heartbeats = self._seen_heartbeats = self._silence_ns = 0
        self._rate = HeartbeatRate()
        self._sends_heartbeat = not isinstance(options, AxisOptions) or options.heartbeat
        self._has_booted = False
        self.boot_ns = 0
        self.clock, self._bus, self._common = clock, bus, common
        self._expected = options.identity
        self._profile = profile
        path = f"{bus.name} → {self.name}"
        self.sdo = Sdo(bus, self.number, path, dictionary, common.sdo_timeout_s, common.sdo_tries)
        bus.subscribe(_HEARTBEAT + self.number, self._on_heartbeat)
        bus.subscribe(_EMCY + self.number, self._on_emergency)

    def share(self, options: NodeOptions, dictionary: ObjectDictionary) -> None:
        """A further axis of the drive."""
        known = {(value.index, value.sub) for value in self.dcf_values}
        further = self._dcf_values(options, dictionary)
        self.dcf_values += [one for one in further if (one.index, one.sub) not in known]
        self.startup += startup_writes(options)
        self._skipped.update(options.skip_writes)

    def identify(self) -> None:
        """Profile and identity. Raises OperationError or DeviceTimeout naming step and object."""
        self.sdo.doubled = False
        self.command(NmtCommand.PRE_OPERATIONAL)  # a stopped node answers no SDO
        with _step("identity"), self.require_unique_id(patient=True):
            profile = self.sdo.read(0x1000) & 0xFFFF
            if profile != self._profile:
                raise OperationError(
                    f"device type 0x1000 is CiA {profile}, expected is CiA {self._profile}"
                )
            self.identity = tuple(self._identity_part(sub) for sub in range(1, 5))
        for sub, key in enumerate(IDENTITY):
            expected, actual = getattr(self._expected, key), self.identity[sub]
            if expected is not None and expected != actual:
                raise OperationError(
                    f"identity: 0x1018:{sub + 1:02X} ({key}) is 0x{actual:08X},"
                    f" expected is 0x{expected:08X}"
                )

    def configure(self, pdos: Sequence[Pdo]) -> None:
        """Pre-operational, heartbeats, start-up objects, PDOs."""
        self.configured = self._has_booted = False
        self.command(NmtCommand.PRE_OPERATIONAL)
        with _step("heartbeat"):
            self._write_heartbeat()
            self.watch_master(watch=True)
        with _step("PDO configuration"):
            for reason in disable_others(self.sdo, tuple(pdos)):
                log.warning("unused PDO stays enabled", node=self.name, reason=reason)
            for pdo in pdos:
                configure(self.sdo, pdo)
        with _step("DCF values"):
            for one in self.dcf_values:
                if not one.is_readable or self.sdo.upload(one.index, one.sub) != one.data:
                    self.sdo.download(one.index, one.sub, one.data)
        with _step("start-up objects"):
            for index, sub, value in self.startup:
                self.sdo.write(index, sub, value, retry=False)

    def start(self) -> None:
        """Start the node and wait for a heartbeat in state OPERATIONAL. Raises OperationError."""
        if self._has_booted:
            raise OperationError(f"NMT start: {RESET}")
        self.state, self._silence_ns = NmtState.UNKNOWN, 0
        self.forget_emergency_before(self.boot_ns)
        self.command(NmtCommand.START)
        poll_s = _POLL_S if self._sends_heartbeat else _GUARD_S
        if not wait_until(self._is_operational, _START_TIMEOUT_S, self.clock, poll_s):
            raise OperationError(f"NMT start: {self._start_failure()}")

    def _is_operational(self) -> bool:
        """Return True in that state; a node without heartbeats is asked for it (node guarding)."""
        if self.state is NmtState.OPERATIONAL:
            return True
        if not self._sends_heartbeat:
            self._bus.send_message(_HEARTBEAT + self.number, b"", remote=True)
        return False

    def enter(self) -> None:
        """Take the node, which has started, into operation."""
        self.fault, self.online, self.configured = "", True, True

    def _start_failure(self) -> str:
        """Return the state and the errors of a node that does not start."""
        silent = self.state in (NmtState.UNKNOWN, NmtState.BOOT_UP)
        state = self.state.name.lower().replace("_", "-")
        parts = ["no heartbeat" if silent else f"it is {state}"]
        if self.boot_ns:
            age_s = (self.clock.now_ns() - self.boot_ns) / NANOSECONDS
            parts.append(f"its last boot-up message came {age_s:.1f} s ago")
        with suppress(RobotdError):
            parts.append(f"error register 0x1001 is {register_text(self.sdo.read(0x1001))}")
            latest = self.sdo.read(0x1003, 1) & 0xFFFF if self.sdo.read(0x1003) else 0
            parts += [f"latest error 0x1003:01 is {error_text(latest)}"] if latest else []
        causes = f"{', '.join(parts)}{self.emergency_text()}"
        return f"not operational within {_START_TIMEOUT_S:g} s: {causes}"

    def command(self, command: NmtCommand) -> None:
        """Send an NMT command to this node alone."""
        self._bus.send_message(0, bytes([command, self.number]))

    def watch_master(self, *, watch: bool) -> None:
        """Make the node supervise our heartbeat, if it can (object 0x1016)."""
        if _CONSUMER in self._skipped:
            return
        limit_ms = round(self._common.heartbeat_timeout_s * 1000) if watch else 0
        found = variable(self.sdo.dictionary, _CONSUMER, 1)
        reason = "0x1016 is missing or read-only"
        if found is not None and found.writable:
            try:
                self.sdo.write(_CONSUMER, 1, self._common.master_node << 16 | limit_ms)
            except SdoAbort as error:
                reason = self.unwatched = error.reason
            else:
                return
        if not self._supervision_reported:
            self._supervision_reported = True
            effect = "the node does not notice that robotd is lost"
            log.warning("object not written", node=self.name, reason=reason, effect=effect)

    def loss_cause(self, period_ns: int, limit_ns: int) -> str:
        """Return why the node is lost, ``period_ns`` later; "" if it is not. Control loop."""
        self._silence_ns += period_ns
        if self._heartbeats != self._seen_heartbeats:
            self._seen_heartbeats, self._silence_ns = self._heartbeats, 0
        if self._has_booted:
            return RESET
        if self.state is not NmtState.OPERATIONAL:
            return f"it went to {self.state.name.lower().replace('_', '-')} by itself"
        if self._silence_ns > limit_ns and self._sends_heartbeat:
            self.lost_heartbeats += self.online
            return f"no heartbeat for {self._silence_ns / 1e6:.0f} ms"
        return ""

    @contextmanager
    def require_unique_id(self, *, patient: bool = False) -> Iterator[None]:
        """Raise OperationError if another node with this id answers within the block.

        Args:
            patient: wait for a late second answer after success, too; always after a failure.
        """
        try:
            yield
        except RobotdError as error:
            if self._is_answered_twice():
                raise OperationError(ANSWERS) from error
            raise
        if self.sdo.doubled or (patient and self._is_answered_twice()):
            raise OperationError(ANSWERS)

    def duplicate(self, now_ns: int) -> str:
        """Return a sign of another node with this id; "" without one. Control loop."""
        if self.sdo.doubled:
            return ANSWERS
        return HEARTBEATS if self._rate.is_doubled(self._heartbeats, now_ns) else ""

    def _is_answered_twice(self) -> bool:
        return wait_until(lambda: self.sdo.doubled, self._common.sdo_timeout_s, self.clock)

    def _unwatched(self, dictionary: ObjectDictionary) -> str:
        """Return why 0x1016 cannot be written, as far as files tell; "" if it can."""
        found = variable(dictionary, _CONSUMER, 1)
        if _CONSUMER in self._skipped:
            return "0x1016 is not written (skip_writes)"
        return "" if found is not None and found.writable else "0x1016 is missing or read-only"

    @staticmethod
    def _dcf_values(options: NodeOptions, dictionary: ObjectDictionary) -> list[DcfValue]:
        values = dcf_values(dictionary) if options.dcf_values else []
        return [value for value in values if not value.skipped]

    def _write_heartbeat(self) -> None:
        """Set the heartbeat period, and read the one that the node has made of it."""
        self._rate.period_s = 0.0
        if not self._sends_heartbeat:
            return
        self.sdo.write(0x1017, 0, round(self._common.heartbeat_s * 1000))
        try:
            self._rate.period_s = self.sdo.read(0x1017) / 1000
        except SdoAbort:
            return  # its rate is not supervised

    def _identity_part(self, sub: int) -> int:
        try:
            return self.sdo.read(0x1018, sub) & 0xFFFFFFFF
        except SdoAbort:
            return 0  # all but the first are optional (CiA 301, 7.5.2.19)

    def _on_heartbeat(self, data: bytearray) -> None:
        self.state = heartbeat_state(data)
        self._heartbeats += 1
        if self.state is NmtState.BOOT_UP:
            self._has_booted, self.boot_ns = True, self.clock.now_ns()
        if self.state is not NmtState.OPERATIONAL:
            self.configured = False

    def _on_emergency(self, data: bytearray) -> None:
        self.note_emergency(data, self.clock.now_ns())


@contextmanager
def _step(name: str) -> Iterator[None]:
    """Prefix errors with the name of the step; they keep type and code."""
    try:
        yield
    except RobotdError as error:
        error.reason = f"{name}: {error.reason}"
        raise
