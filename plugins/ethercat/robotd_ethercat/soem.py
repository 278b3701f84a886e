"""SOEM through pysoem: one lock for mailbox transfers, and its errors as those of robotd.

pysoem is imported here and nowhere else. It holds the interpreter lock in each call that has no
``release_gil``: those take at most the round trip of one frame here, except while the bus is
brought up.
"""

from __future__ import annotations

import select
import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

from robotd.api import ConnectError, DeviceTimeout, OperationError, PluginError
from robotd_cia402.drive_access import SdoAbort
from robotd_ethercat.al_status import ERROR_FLAG, AlState, al_state
from robotd_ethercat.network_interface import (
    prepared,
    problem_of,
    raw_sockets,
    unsent_bytes,
)

INSTALL = "pip install 'robotd[ethercat]' (robotd docs how-to/ethercat)"
NO_FRAME = -1  # working counter of a frame that did not come back
MAX_OBJECT_BYTES = 4096
_MICROSECONDS = 1_000_000
_WATCHDOG_REGISTER = 0x0420  # process data watchdog (ETG.1000.4)
_TRIES = 3  # of a mailbox transfer, and of a register
_REGISTER_RETRY_S = 0.02  # outlasts a short stall of the computer
_FRAME_TIMEOUT_US = 2000  # of SOEM
_SERIAL_WORD = 0x000E  # of the SII (ETG.1000.6)
_AL_STATUS, _AL_LAYOUT = 0x0130, struct.Struct("<H2xH")  # register, and status code behind it
_AL_BITS = 0x3F  # of the register that have a meaning: state, error, identification
_COMMAND, _INDEX = 16, 17  # offsets in an Ethernet frame: first datagram's command, and its number
_ONE_FRAME_BYTES = 1466  # of process data; SOEM divides more
_LOGICAL = {10, 11, 12}  # LRD, LWR, LRW: commands of process data (ETG.1000.4, table 8)

Opener = Callable[[Callable[[], None]], None]


class SlaveState(NamedTuple):
    """AL status of one slave. ``error``: it rejected or left a state; ``code``: why."""

    state: AlState
    error: bool
    code: int


NO_ANSWER = SlaveState(AlState.NONE, error=False, code=0)


class MappingError(OperationError):
    """The mapping was not read without an error. ``slaves``: places of those that have one."""

    def __init__(self, reason: str, slaves: frozenset[int]) -> None:
        super().__init__(reason)
        self.slaves = slaves


class Soem:
    """One EtherCAT master on one interface, or on two with redundancy.

    Worker threads, except ``send`` and ``receive``: one thread at a time, the control loop while
    process data are exchanged.

    Args:
        opener: calls the function that opens the sockets, in another network namespace for
            example; None: here.

    Attributes:
        slaves: those found by the last ``find_slaves``.
        plain_sdo: places of slaves whose mapping is not read by complete access, from the next
            ``find_slaves`` on.
    """

    def __init__(self, sdo_timeout_s: float, opener: Opener | None = None) -> None:
        self.slaves: Sequence[Any] = ()
        self._pysoem = _library()
        self._sdo_timeout_us = round(sdo_timeout_s * _MICROSECONDS)
        self._opener = opener or _call
        self._frame_timeout_us = _FRAME_TIMEOUT_US
        self._mailbox = threading.Lock()
        self._master: Any = None
        self._sockets: list[socket.socket] = []
        self._several_frames = False
        self._kept_bytes = 0  # that count as unsent although all frames are back
        self.plain_sdo: set[int] = set()

    def open(self, interface: str, redundant_interface: str | None) -> None:
        """Open the sockets. Raises ConnectError with the reason and what to do."""
        master = self._pysoem.Master()
        master.manual_state_change = 1
        master.sdo_read_timeout = master.sdo_write_timeout = self._sdo_timeout_us
        interfaces = [name for name in (interface, redundant_interface) if name is not None]
        others = raw_sockets()

        def connect() -> None:
            reason, permanent = problem_of(interfaces)
            if reason:
                failures = {f"ethercat → {interface}": reason}
                raise ConnectError(message, failures, permanent=permanent)
            master.open(interface, redundant_interface)

        message = "the network interface cannot be opened"
        try:
            self._opener(connect)
        except ConnectionError as error:
            reason = "SOEM cannot open a raw socket on it; `robotd ethercat doctor` shows more"
            raise ConnectError(message, {f"ethercat → {interface}": reason}) from error
        self._master = master
        self._sockets = [prepared(descriptor) for descriptor in raw_sockets() - others]

    def set_frame_timeout(self, seconds: float) -> None:
        """Set SOEM's time-out of a frame, except for those of process data."""
        self._frame_timeout_us = round(seconds * _MICROSECONDS)
        self._pysoem.settings.timeouts.ret = self._frame_timeout_us

    def close(self) -> None:
        """Close the sockets, after a mailbox transfer that runs. Twice is not an error."""
        with self._mailbox:  # SOEM would go on with a descriptor that may be another file's by then
            master, self._master, self.slaves = self._master, None, ()
            if master is not None:
                master.close()
        while self._sockets:
            self._sockets.pop().close()

    def find_slaves(self) -> int:
        """Enumerate the slaves, which go to Init; return their number."""
        found = self._master.config_init(release_gil=True)
        self.slaves = self._master.slaves if found > 0 else ()
        for number, slave in enumerate(self.slaves):
            if number in self.plain_sdo:
                slave._disable_complete_access()  # noqa: SLF001 - the library has no public name
        return len(self.slaves)

    def states(self) -> list[SlaveState]:
        """Read the AL status of all slaves, one after the other.

        After three without an answer the others are not asked: each takes a whole time-out.
        """
        found: list[SlaveState] = []
        count = len(self.slaves)
        while len(found) < count and found[-_TRIES:] != [NO_ANSWER] * _TRIES:
            found.append(self.state(len(found)))
        return found + [NO_ANSWER] * (count - len(found))

    def state(self, slave: int) -> SlaveState:
        """Read the AL status of a slave; ``NO_ANSWER`` without a plausible one.

        ``read_state`` of pysoem reads all with one frame. Where that is late or lost, it returns
        what its buffer holds, process data for example, whatever the working counter says.
        """
        try:
            data = self._slave(slave)._fprd(_AL_STATUS, _AL_LAYOUT.size, self._frame_timeout_us)  # noqa: SLF001 - as read_register
        except self._pysoem.WkcError:
            return NO_ANSWER
        register, code = _AL_LAYOUT.unpack(data)
        state = al_state(register)
        if state is AlState.NONE or register & ~_AL_BITS:  # a late answer to another request
            return NO_ANSWER
        return SlaveState(state, bool(register & ERROR_FLAG), code)

    def request(
        self, state: AlState, slave: int | None = None, *, acknowledge: bool = False
    ) -> None:
        """Request ``state`` of one slave, or of all; ``acknowledge`` its error."""
        target = self._master if slave is None else self._slave(slave)
        target.state = state | (ERROR_FLAG if acknowledge else 0)
        target.write_state()

    def find_again(self, slave: int) -> bool:
        """Set the address of a slave that lost it; True if it answers."""
        return bool(self._slave(slave).recover() > 0)

    def map(self) -> None:
        """Configure sync managers and FMMUs of all slaves. Raises MappingError.

        SOEM cannot repeat it before the next ``find_slaves``.
        """
        try:
            self._master.config_map()
        except self._pysoem.ConfigMapError as error:
            reasons = "; ".join(dict.fromkeys(self._text(one) for one in error.error_list))
            places = {getattr(one, "slave_pos", 0) - 1 for one in error.error_list}
            raise MappingError(
                f"the process data cannot be mapped: {reasons}", frozenset(places - {-1})
            ) from error
        size = sum(len(slave.output) + len(slave.input) for slave in self.slaves)
        self._several_frames = size > _ONE_FRAME_BYTES

    def find_clocks(self) -> bool:
        """Measure the delays between distributed clocks; False if no slave has one."""
        return bool(self._master.config_dc())

    def set_sync0(self, slave: int, period_ns: int, shift_ns: int, *, active: bool) -> None:
        """Start or stop SYNC0 of a slave."""
        self._slave(slave).dc_sync(active, period_ns, shift_ns)

    def set_watchdog(self, slave: int, milliseconds: float) -> None:
        """Set the process data watchdog of a slave. Raises OperationError."""
        try:
            self._register(
                slave,
                _WATCHDOG_REGISTER,
                lambda one, _: one.set_watchdog("processdata", milliseconds),
            )
        except (AttributeError, DeviceTimeout) as error:
            raise OperationError(f"watchdog_ms {milliseconds:g} was not taken: {error}") from error

    @property
    def expected_counter(self) -> int:
        """Working counter of the process data when all slaves are operational."""
        return int(self._master.expected_wkc)

    @property
    def bus_time_ns(self) -> int:
        """Time of the reference clock when the last frame passed it; 0 without clocks."""
        return int(self._master.dc_time)

    def note_all_sent(self) -> None:
        """Note that all frames are back: what counts as unsent now, the driver frees late."""
        self._kept_bytes = self._unsent_bytes()

    @property
    def is_blocked(self) -> bool:
        """Frames wait in a network interface, as far as its driver tells. Control loop."""
        return self._unsent_bytes() > self._kept_bytes

    def _unsent_bytes(self) -> int:
        return sum([unsent_bytes(one) for one in self._sockets])

    def send(self) -> None:
        """Send the process data of all slaves."""
        self._master.send_processdata()

    def receive(self, timeout_us: int, *, release_gil: bool) -> int:
        """Receive the frames sent last; return the working counter, ``NO_FRAME`` without them."""
        return int(self._master.receive_processdata(timeout_us, release_gil=release_gil))

    def await_process_data(self, timeout_s: float) -> bool:
        """Wait until process data have come back; False: not in time, or behind other answers.

        ``receive`` gives a frame up that is not there yet, so process data of several frames are
        not awaited: they come back one after the other. With a redundant interface SOEM sends an
        empty frame of the same number into the other end, and receives both.
        """
        if self._several_frames:
            return False
        end_s = time.monotonic() + timeout_s
        commands, numbers = set(), set()
        for one in self._sockets:
            left_s = max(0.0, end_s - time.monotonic())
            try:
                if not select.select([one], [], [], left_s)[0]:
                    return False
                head = one.recv(_INDEX + 1, socket.MSG_PEEK)
            except (OSError, ValueError):
                # Another thread's transfer has taken the frame, for SOEM to keep; the interface is
                # down; or the descriptor is too large for ``select``.
                return False
            commands.add(head[_COMMAND])
            numbers.add(head[_INDEX])
        return not commands.isdisjoint(_LOGICAL) and len(numbers) == 1

    def drop_late_frames(self) -> bool:
        """Discard frames that wait in the sockets; return True if process data were among them.

        SOEM numbers its frames from 0 to 15. After a pause of the bus it takes a late frame for a
        later one of the same number, and from then on each frame 16 periods late.
        """
        found = False
        for one in self._sockets:
            with suppress(OSError):  # nothing waits, or the interface is down
                while head := one.recv(_COMMAND + 1):
                    found |= head[_COMMAND] in _LOGICAL
        return found

    def upload(self, slave: int, index: int, sub: int) -> bytes:
        """Read an object by SDO. Raises SdoAbort, DeviceTimeout, OperationError."""
        return bytes(
            self._transfer(
                lambda one: one.sdo_read(index, sub, MAX_OBJECT_BYTES, release_gil=True), slave
            )
        )

    def download(
        self, slave: int, index: int, sub: int, data: bytes, *, retry: bool = True
    ) -> None:
        """Write an object by SDO. Raises SdoAbort, DeviceTimeout, OperationError.

        Args:
            retry: repeat it where no answer comes. The slave may have executed it all the same,
                and a command such as a store takes seconds: only for values.
        """

        def write(one: Any) -> None:
            one.sdo_write(index, sub, data, release_gil=True)

        self._transfer(write, slave, _TRIES if retry else 1)

    def poll_mailbox(self, slave: int) -> None:
        """Receive an emergency that waits in the mailbox of a slave, for its callbacks."""
        self._transfer(lambda one: one.mbx_receive(), slave)

    def on_emergency(self, slave: int, handler: Callable[[bytes], None]) -> None:
        """Call ``handler`` with the 8 bytes of each emergency, in the polling thread."""

        def receive(message: Any) -> None:
            vendor = message.b1.to_bytes(1, "little") + message.w1.to_bytes(2, "little")
            head = message.error_code.to_bytes(2, "little") + bytes([message.error_reg])
            handler(head + vendor + message.w2.to_bytes(2, "little"))

        self._slave(slave).add_emergency_callback(receive)

    def read_register(self, slave: int, address: int, size: int) -> bytes:
        """Read registers of a slave controller. Raises DeviceTimeout."""
        read = lambda one, wait_us: one._fprd(address, size, wait_us)  # noqa: SLF001, E731 - the library has no public name for it
        return bytes(self._register(slave, address, read))

    def write_register(self, slave: int, address: int, data: bytes) -> None:
        """Write registers of a slave controller. Raises DeviceTimeout."""
        self._register(slave, address, lambda one, wait_us: one._fpwr(address, data, wait_us))  # noqa: SLF001 - as read_register

    def read_sii(self, slave: int, word: int) -> int:
        """Read 32 bits of the SII EEPROM of a slave, at a word address."""
        return int.from_bytes(self._slave(slave).eeprom_read(word), "little")

    def identity(self, slave: int) -> tuple[int, int, int, int]:
        """Return vendor, product, revision and serial of the SII."""
        one = self._slave(slave)
        return one.man, one.id, one.rev, self.read_sii(slave, _SERIAL_WORD)

    def _slave(self, number: int) -> Any:
        """Return a slave of SOEM. Raises OperationError after ``close``."""
        if number >= len(self.slaves):
            raise OperationError(f"slave {number} is not there: the bus is closed")
        return self.slaves[number]

    def _register(self, slave: int, address: int, action: Callable[[Any, int], Any]) -> Any:
        for left in reversed(range(_TRIES)):
            with suppress(self._pysoem.WkcError):
                return action(self._slave(slave), self._frame_timeout_us)
            if left:
                time.sleep(_REGISTER_RETRY_S)
        raise DeviceTimeout(f"register 0x{address:04X}: no answer, {_TRIES} tries")

    def _transfer(self, action: Callable[[Any], Any], slave: int, tries: int = _TRIES) -> Any:
        library = self._pysoem
        with self._mailbox:
            for _ in range(tries):
                try:
                    return action(self._slave(slave))
                except library.SdoError as error:
                    raise SdoAbort(self._text(error), error.abort_code & 0xFFFFFFFF) from error
                except (library.MailboxError, library.PacketError) as error:
                    raise OperationError(self._text(error)) from error
                except library.WkcError:  # a frame was lost, or no answer came in time
                    self._drop_late_answers(slave)
        limit_s = self._sdo_timeout_us / _MICROSECONDS
        once = "not repeated; it may have been executed, read the object back"
        after = f"{tries} tries" if tries > 1 else once
        raise DeviceTimeout(f"no answer of the mailbox within {limit_s:g} s, {after}")

    def _drop_late_answers(self, slave: int) -> None:
        """Empty the mailbox: SOEM would take a late answer as that of another subindex."""
        library = self._pysoem
        with suppress(library.SdoError, library.MailboxError, library.WkcError):
            while self._slave(slave).mbx_receive() > 0:
                continue

    def _text(self, error: Exception) -> str:
        library = self._pysoem
        if isinstance(error, library.SdoError):
            code = error.abort_code & 0xFFFFFFFF
            return f"slave {error.slave_pos - 1}: abort 0x{code:08X}, {error.desc.lower()}"
        if isinstance(error, library.MailboxError | library.PacketError):
            return f"slave {error.slave_pos - 1}: mailbox error {error.error_code}, {error.desc}"
        return f"{type(error).__name__}: {error}"


def _library() -> Any:
    """Import pysoem. Raises PluginError with the command that installs it."""
    try:
        import pysoem
    except ImportError as error:
        raise PluginError(f"backend 'ethercat' needs pysoem, {error}: {INSTALL}") from error
    return pysoem


def _call(action: Callable[[], None]) -> None:
    action()
