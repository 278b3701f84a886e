"""The three connections to the controller."""

from __future__ import annotations

import socket
import struct
import threading
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    FloatArray,
    NotReady,
    OperationError,
)
from robotd_dobot_tcp import protocol
from robotd_dobot_tcp.options import DobotOptions

TIMEOUT_S = 2.0  # to connect, and for a reply
SILENT_S = 0.1  # without a packet is a fault
ABORT = struct.pack("ii", 1, 0)  # SO_LINGER: a close discards what is not sent, and resets the peer


@dataclass(frozen=True)
class Feedback:
    """Content of one packet in SI units.

    Attributes:
        time_ns: monotonic time of its arrival.
        alarm: number of the controller's alarm; 0: none.
        inputs, outputs: digital levels; bit 0 of byte 0 is terminal 1.
    """

    time_ns: int
    position: FloatArray
    velocity: FloatArray
    enabled: bool
    alarm: int
    inputs: bytes
    outputs: bytes


class Link:
    """Connections for commands, targets and feedback. Any thread, except ``send_target``.

    Attributes:
        feedback: content of the newest packet; None before the first one.
        failure: reason why the connections are lost; "" while they are there.
    """

    def __init__(self, options: DobotOptions, clock: Clock) -> None:
        self.feedback: Feedback | None = None
        self.failure = ""
        self._options, self._clock = options, clock
        self._command_lock = threading.Lock()
        self._sockets: dict[str, socket.socket] = {}
        self._unanswered: list[int] = []  # times of targets without a reply
        self._alarm = 0
        self._thread = threading.Thread(target=self._receive, name="dobot-feedback", daemon=True)
        self._connect()

    def _connect(self) -> None:
        options, failures = self._options, {}
        ports = {
            "dashboard": options.dashboard_port,
            "motion": options.motion_port,
            "feedback": options.feedback_port,
        }
        for name, port in ports.items():
            try:
                found = socket.create_connection((options.address, port), TIMEOUT_S)
            except OSError as error:
                failures[f"{name} port {options.address}:{port}"] = str(error)
            else:
                found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets[name] = found
        if failures:
            self.close()
            raise ConnectError("the controller does not answer", failures)
        motion = self._sockets["motion"]
        motion.setblocking(False)
        motion.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABORT)
        self._thread.start()

    def close(self) -> None:
        """End all connections and the thread."""
        for connection in self._sockets.values():
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()
        if self._thread.is_alive():
            self._thread.join(TIMEOUT_S)

    def command(self, name: str, *values: float) -> str:
        """Send a command to the dashboard and return the value of its reply.

        Raises OperationError: it was rejected. NotReady: no reply came.
        """
        dashboard, reply = self._sockets["dashboard"], b""
        with self._command_lock:
            try:
                dashboard.sendall(protocol.command(name, *values).encode("ascii"))
                while b";" not in reply:
                    part = dashboard.recv(4096)
                    if not part:
                        raise ConnectionError("closed by the controller")
                    reply += part
            except OSError as error:
                raise NotReady(self._lose(f"{name} without a reply", error)) from error
        return protocol.parse_reply(reply.decode("ascii", "replace"), name)

    def send_target(self, position_deg: FloatArray) -> None:
        """Send a target for all joints. Control-loop thread; never blocks.

        Both ends keep what the controller has not read, and it would execute all of it late. So the
        connection ends where replies do not come.
        """
        motion = self._sockets["motion"]
        message = protocol.servo_target(position_deg, self._options.target_period_s)
        try:
            with suppress(BlockingIOError):
                while replies := motion.recv(4096):
                    del self._unanswered[: replies.count(b";")]
            self._unanswered.append(self._clock.now_ns())
            age_s = (self._unanswered[-1] - self._unanswered[0]) / NANOSECONDS
            if age_s > self._options.max_target_age_s:
                raise BlockingIOError(f"no reply for {age_s:.2g} s")
            if motion.send(message) < len(message):
                raise BlockingIOError("they are not read")
        except OSError as error:
            self._lose("targets cannot be sent", error)

    def _receive(self) -> None:
        """Thread of the feedback: the newest whole packet counts, whatever has queued up."""
        feedback, size, data = self._sockets["feedback"], protocol.FEEDBACK.itemsize, bytearray()
        try:
            while True:
                with suppress(TimeoutError):
                    part = feedback.recv(1 << 16)
                    if not part:
                        raise ConnectionError("closed by the controller")
                    data += part
                if whole := len(data) // size:
                    self._take(data[(whole - 1) * size : whole * size])
                    del data[: whole * size]
        except (OSError, OperationError, NotReady) as error:
            self._lose("feedback", error)

    def _lose(self, what: str, error: Exception) -> str:
        """Note the first failure of any connection, which ends all of them."""
        self.failure = self.failure or f"connection lost ({what}: {error})"
        self._sockets["motion"].close()  # and with it targets that are not delivered
        return self.failure

    def _take(self, packet: bytearray) -> None:
        time_ns = self._clock.now_ns()
        fields = np.frombuffer(packet, protocol.FEEDBACK)[0]
        if fields["size"] != len(packet) or fields["test_value"] != protocol.TEST_VALUE:
            raise OperationError("the bytes are no packet of this protocol")
        if not fields["error"]:
            self._alarm = 0
        elif not self._alarm:  # the packet shows that there is an alarm, the dashboard which one
            self._alarm = protocol.first_alarm(self.command("GetErrorID")) or -1
        self.feedback = Feedback(
            time_ns,
            np.radians(fields["position"]),
            np.radians(fields["velocity"]),
            bool(fields["enabled"]),
            self._alarm,
            fields["inputs"].tobytes(),
            fields["outputs"].tobytes(),
        )

    @property
    def silence(self) -> str:
        """Reason why no fresh values arrive; "" while they do."""
        if self.failure or self.feedback is None:
            return self.failure or "no feedback yet"
        age_s = (self._clock.now_ns() - self.feedback.time_ns) / NANOSECONDS
        return f"no feedback for {age_s:.1f} s" if age_s > SILENT_S else ""
