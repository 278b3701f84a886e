"""CAN bus with a supervised receive thread, handlers by COB-ID, and counters.

The receive loop is our own. The notifier of python-can ends its thread at the first error of the
bus and leaves the last values readable; this one counts malformed frames, distinguishes them from
a lost bus, and reports the latter as ``fault``.
"""

from __future__ import annotations

import errno
import logging
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass

import can

from robotd.api import NANOSECONDS, ConnectError, get_logger, request_realtime
from robotd_canopen.frame import Frame, error_frame_text, wire_bits
from robotd_canopen.options import QUEUELESS, BusOptions

log = get_logger("canopen")
logging.getLogger("canopen").addHandler(logging.NullHandler())  # we report its errors ourselves
logging.getLogger("can").addHandler(logging.NullHandler())

Handler = Callable[[bytearray], None]
"""Called in the receive thread with the data of a frame; ValueError: the frame is malformed."""

_POLL_S = 0.1  # after which the receive thread sees that it is to end
_RETRY_INTERVAL_S = 0.01  # between attempts while the bus fails
_MAX_FAILURES = 20  # consecutive failed calls after which the bus is lost
_FULL = (errno.ENOBUFS, errno.EAGAIN)  # the queue of the interface, or the buffer of the socket
_FULL_TEXT = "Transmit buffer full"  # of python-can for the latter
_SEND_BUFFER_BYTES = 832  # that the kernel counts for one waiting frame

_PERMANENT = {
    errno.EPERM: "no permission: run as a user who may use the adapter",
    errno.EACCES: "no permission: run as a user who may use the adapter",
    errno.EAFNOSUPPORT: "this kernel has no CAN (AF_CAN): sudo modprobe can can_raw",
    errno.EPROTONOSUPPORT: "this kernel has no raw CAN sockets: sudo modprobe can_raw",
    errno.ENODEV: "there is no such interface: ip -br link show type can lists them",
}
"""Errors that a further attempt does not end, with the remedy."""


@dataclass(slots=True)
class Counters:
    """Counters of frames and errors since the bus was opened."""

    received: int = 0
    sent: int = 0
    data_bytes: int = 0
    malformed: int = 0
    error_frames: int = 0
    receive_errors: int = 0
    send_errors: int = 0
    dropped: int = 0  # not sent, because as many as may wait did


class Bus:
    """One open or closed CAN bus. Any thread may send.

    Args:
        realtime_priority: SCHED_FIFO priority of the receive thread, where the system grants
            it; 0: none.
        max_waiting: frames that may wait to be sent, where the interface can limit them; 0: any
            number. What is sent beyond is dropped.

    Attributes:
        fault: why the bus cannot be used, None while it can; stays until ``open``.
        last_malformed: the latest malformed frame, as text; "" without one.
        last_error: text of the latest error frame of the controller; "" without one.
        load: part of the bit rate that frames took between the last two ``measure_load``.
        seen: COB-IDs that have been received since ``open``.
        keeps_unsent: frames may wait in the adapter, any number of them, and cannot be discarded.
    """

    def __init__(
        self, options: BusOptions, realtime_priority: int = 0, max_waiting: int = 0
    ) -> None:
        self.name = "virtual" if options.channel is None else str(options.channel)
        self.bitrate = options.bitrate
        self.fault: str | None = None
        self.last_malformed = self.last_error = ""
        self.load = 0.0
        self.counters = Counters()
        self._load_from = (0, 0.0)
        self.seen: set[int] = set()
        self._options = options
        self._priority, self._max_waiting = realtime_priority, max_waiting
        self._handlers: dict[int, Handler] = {}
        self._can: can.BusABC | None = None
        self._thread: threading.Thread | None = None
        self._ending = threading.Event()
        self._lock = threading.Lock()
        self._failures = 0
        self._discards = self.keeps_unsent = False

    @property
    def is_open(self) -> bool:
        return self._can is not None

    def open(self) -> None:
        """Open the bus (again, with counters at 0) and start to receive. Raises ConnectError."""
        self.close()
        options = self._options
        try:
            opened = can.Bus(
                channel=options.channel,
                interface=options.interface,
                bitrate=options.bitrate,
                **options.options,
            )
        except Exception as error:
            raise _open_failure(error, options) from error
        self.fault, self.counters, self._failures = None, Counters(), 0
        self.last_malformed = self.last_error = ""
        self.seen.clear()
        self._limit_queue(opened)
        self._ending = threading.Event()
        self._can = opened
        self._thread = threading.Thread(
            target=self._receive, args=(opened, self._ending), name="canopen-receive", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop to receive and close. Twice is not an error."""
        opened, self._can = self._can, None
        if opened is None:
            return
        self._ending.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(2.0)
        try:
            opened.shutdown()
        except Exception as error:  # noqa: BLE001 - closing a removed adapter fails
            log.warning("closing the CAN bus failed", reason=str(error))

    def subscribe(self, cob_id: int, handler: Handler) -> None:
        """Call ``handler`` with the frames of ``cob_id``; one handler each."""
        self._handlers[cob_id] = handler

    def send(self, message: can.Message) -> bool:
        """Send a frame; False when it failed, which is counted. Never raises."""
        opened = self._can
        if opened is None:
            return False
        try:
            with self._lock:
                opened.send(message)
        except Exception as error:  # noqa: BLE001 - drivers raise what they like
            if _is_full(error):  # nodes that do not answer show it; a lost adapter is another error
                self.counters.dropped += 1
                if self.counters.dropped == 1:
                    log.warning("frames are not sent: as many wait as may", bus=self.name)
                return False
            self.counters.send_errors += 1
            self._failed(f"sending on {self.name} failed: {type(error).__name__}: {error}")
            return False
        self.counters.sent += 1
        self.counters.data_bytes += message.dlc
        return True

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a frame; the name by which the library's SDO client calls it.

        Raises can.CanOperationError.
        """
        message = Frame(can_id, data)
        message.is_remote_frame = remote
        if not self.send(message):
            state = "takes no frames" if self.is_open else "is not open"
            raise can.CanOperationError(self.fault or f"the bus {self.name} {state}")

    def discard_unsent(self) -> None:
        """Discard frames that wait in the adapter, where its interface can. Never raises."""
        opened = self._can
        if opened is not None and self._discards:
            try:
                with self._lock:
                    opened.flush_tx_buffer()
            except Exception as error:  # noqa: BLE001 - drivers raise what they like
                self._discards = False
                log.warning("unsent frames cannot be discarded", reason=str(error))

    def measure_load(self, now_ns: int) -> None:
        """Bring ``load`` up to date; called regularly by the control loop."""
        counters = self.counters
        bits = wire_bits(counters.received + counters.sent, counters.data_bytes)
        since_ns, before = self._load_from
        self._load_from = (now_ns, bits)
        if since_ns and bits >= before:
            self.load = (bits - before) / ((now_ns - since_ns) / NANOSECONDS * self.bitrate)

    def _limit_queue(self, opened: can.BusABC) -> None:
        """Let no frame wait for long: a drive would execute setpoints of the past.

        The kernel keeps the frames of a closed SocketCAN socket, and sends them when it can; so
        their number is limited by the send buffer.
        """
        interface = self._options.interface
        self._discards = type(opened).flush_tx_buffer is not can.BusABC.flush_tx_buffer
        self.keeps_unsent = False
        if not self._max_waiting or self._discards or interface in QUEUELESS:
            return
        if interface == "socketcan":
            size = self._max_waiting * _SEND_BUFFER_BYTES
            opened.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, size)  # type: ignore[attr-defined]
        else:
            self.keeps_unsent = True
            effect = "after a blocked bus each drive executes up to three late setpoints"
            log.warning("unsent frames cannot be discarded", interface=interface, effect=effect)

    def _receive(self, opened: can.BusABC, ending: threading.Event) -> None:
        request_realtime(self._priority)
        counters, handlers = self.counters, self._handlers
        while not ending.is_set():
            try:
                message = opened.recv(_POLL_S)
            except Exception as error:  # noqa: BLE001 - drivers raise what they like
                if not ending.wait(_RETRY_INTERVAL_S if self._failures else 0.0):
                    counters.receive_errors += 1
                    reason = f"{type(error).__name__}: {error}"
                    self._failed(f"receiving on {self.name} failed: {reason}")
                continue
            if message is None:
                continue
            if self._failures:
                self._failures = 0
            counters.received += 1
            counters.data_bytes += message.dlc
            if message.is_error_frame:
                counters.error_frames += 1
                self.last_error = error_frame_text(message)
                continue
            handler = handlers.get(message.arbitration_id)
            if handler is None or message.is_remote_frame or message.is_extended_id:
                self.seen.add(message.arbitration_id)
                continue
            try:
                handler(message.data)
            except Exception as error:  # noqa: BLE001 - nothing that arrives may end the thread
                self._malformed(message, error)

    def _malformed(self, message: can.Message, error: Exception) -> None:
        self.counters.malformed += 1
        self.last_malformed = (
            f"frame 0x{message.arbitration_id:03X} [{bytes(message.data).hex(' ')}]: {error}"
        )
        if self.counters.malformed == 1:
            log.warning("malformed frame", reason=self.last_malformed)

    def _failed(self, reason: str) -> None:
        self._failures += 1
        if self._failures >= _MAX_FAILURES and self.fault is None:
            self.fault = reason
            log.error("the CAN bus is lost", reason=reason)


def _is_full(error: Exception) -> bool:
    """Return True where as many frames wait as may."""
    return getattr(error, "error_code", None) in _FULL or _FULL_TEXT in str(error)


def _open_failure(error: Exception, options: BusOptions) -> ConnectError:
    """Return the error for what opening the bus raised."""
    number = error.errno if isinstance(error, OSError) else None
    permanent = number in _PERMANENT or isinstance(
        error, can.CanInterfaceNotImplementedError | ImportError
    )
    if number in _PERMANENT:
        reason = _PERMANENT[number]
    elif isinstance(error, OSError) and error.strerror:
        reason = error.strerror
    else:
        reason = f"{type(error).__name__}: {error}"
    path = f"canopen → {options.interface}:{options.channel}"
    return ConnectError("the CAN bus cannot be opened", {path: reason}, permanent=permanent)
