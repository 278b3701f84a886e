"""The connections to the controller: commands, targets and feedback."""

from __future__ import annotations

import socket
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    DeviceTimeout,
    FloatArray,
    NotReady,
    OperationError,
    Payload,
)
from robotd_dobot import protocol
from robotd_dobot.command_port import CommandPort, MotionPort, Request, TargetPort
from robotd_dobot.options import DobotOptions
from robotd_dobot.protocol import DIALECTS, MODELS, TAKES_TARGETS, V3, V4, Dialect
from robotd_dobot.tool_terminals import ToolTerminals

TIMEOUT_S = 2.0  # to connect, and for a reply
SILENT_S = 0.1  # without a packet is a fault
SWITCH_OFF = "DisableRobot"
MAX_ANGLE_DEG = 1080.0  # of any joint; more is not a position
NOT_IN_TCP_MODE = (
    "the controller is not in TCP mode and does not change to it now: switch the arm off, and"
    " choose TCP/IP secondary development in the maker's software"
)


@dataclass(frozen=True)
class Feedback:
    """Content of one packet in SI units.

    Attributes:
        time_ns: monotonic time of its arrival.
        mode: of the controller, see ``Dialect.modes``.
        enabled: the servos are on, by any client.
        dragged: the arm is moved by hand.
        alarm: number of the controller's alarm; 0: none.
        inputs, outputs: digital levels; bit 0 of byte 0 is terminal 1.
        model: of the arm; "" where it is not known.
        payload: that the controller compensates.
        frames: index of the selected frame, by the command that selects it.
    """

    time_ns: int
    position: FloatArray
    velocity: FloatArray
    mode: int
    enabled: bool
    dragged: bool
    alarm: int
    inputs: bytes
    outputs: bytes
    model: str
    payload: Payload
    frames: Mapping[str, int]

    @property
    def takes_targets(self) -> bool:
        """The servos are on, and nothing else moves the arm."""
        return self.enabled and not self.dragged and self.mode in TAKES_TARGETS


class ControllerLink:
    """Connections for commands, targets and feedback. Any thread.

    Attributes:
        dialect: generation of the controller.
        feedback: content of the newest packet; None before the first one.
        failure: reason why the connections are lost; "" while they are there.
        tool: terminals of the tool; None: the options leave them out.
    """

    def __init__(self, options: DobotOptions, clock: Clock) -> None:
        self.feedback: Feedback | None = None
        self.failure = ""
        self.tool: ToolTerminals | None = None
        self.dialect: Dialect = DIALECTS.get(options.controller, V4)
        self._options, self._clock = options, clock
        self._implausible = ""
        self._alarm = 0
        self._alarm_query: Request | None = None
        self._thread = threading.Thread(target=self._receive, name="dobot-feedback", daemon=True)
        commands, self._feedback = _connect(
            options.address, command=options.command_port, feedback=options.feedback_port
        )
        self._commands = CommandPort(commands, clock)
        self._targets: TargetPort = self._commands
        self._thread.start()
        try:
            self._find_generation()
        except BaseException:
            self.close()
            raise
        if options.tool_io:
            self.tool = ToolTerminals(self._commands, self.dialect)

    def _find_generation(self) -> None:
        options = self._options
        if options.controller == "auto":
            try:
                self.command(protocol.GENERATION_QUERY)
            except NotReady as error:
                if self.failure:
                    raise ConnectError(f"the controller does not answer: {error}") from error
            except OperationError as error:
                if error.code == protocol.UNKNOWN_COMMAND:
                    self.dialect = V3
        if options.target_period_s < self.dialect.min_target_s:
            shortest = f"{self.dialect.min_target_s:g} s at least"
            text = f"target_period_s is {options.target_period_s:g} s, {self.dialect.name} takes"
            raise ConnectError(f"{text} {shortest}")
        for key, text in options.missing_frames(self.dialect).items():
            raise ConnectError(f"{key}: {text}")
        if self.dialect.has_motion_port:
            (motion,) = _connect(options.address, motion=options.motion_port)
            self._targets = MotionPort(motion, self._clock)

    def close(self) -> None:
        """End all connections and the thread."""
        self._end()
        self._thread.join(TIMEOUT_S)
        self._feedback.close()

    def command(self, name: str, *values: float, timeout_s: float = TIMEOUT_S) -> str:
        """Send a command and return the value of its reply.

        A controller that does not reply for ``TIMEOUT_S`` is lost.
        Raises OperationError: it was rejected. NotReady: lost, or not in TCP mode. DeviceTimeout:
        no reply yet.
        """
        try:
            reply = self._commands.call(protocol.command(name, *values), timeout_s)
        except OSError as error:
            if isinstance(error, TimeoutError) and timeout_s < TIMEOUT_S:
                raise DeviceTimeout(f"{name} without a reply ({error})") from error
            raise NotReady(self._lose(f"{name} without a reply", error)) from error
        return protocol.parse_reply(reply, name)

    def take_control(self) -> None:
        """Let the controller obey TCP, where it has to be asked for that (V4.6).

        Raises NotReady: it does not now.
        """
        if self.dialect is V3:
            return
        try:
            self.command(protocol.GENERATION_QUERY)
        except NotReady:
            if self.failure:
                raise
            try:
                self.command("RequestControl")
            except OperationError as error:
                raise NotReady(f"{NOT_IN_TCP_MODE} ({error})") from error
        except OperationError:
            pass  # in alarm, for example: it obeys

    def post(self, name: str) -> None:
        """Send a command without waiting for its reply. Control-loop thread."""
        try:
            self._commands.post(protocol.command(name))
        except OSError as error:
            self._lose(name, error)

    def send_target(self, position_deg: FloatArray) -> None:
        """Send a target for all joints. Control-loop thread; never blocks."""
        options = self._options
        text = self.dialect.servo_target(
            position_deg, options.target_period_s, options.lookahead, options.gain
        )
        try:
            self._targets.send_target(text)
        except OSError as error:
            self._lose("targets cannot be sent", error)

    def watch_targets(self) -> None:
        """End the connection where targets are not taken. Control-loop thread, in each period.

        Both ends keep what the controller has not read, and it would execute all of it late, also
        where no more are sent.
        """
        try:
            age_s = self._targets.target_age_s()
            if age_s > self._options.max_target_age_s:
                raise BlockingIOError(f"the controller has taken none for {age_s:.2g} s")
        except OSError as error:
            self._lose("targets cannot be sent", error)

    @property
    def rejection(self) -> str:
        """Reason why the controller does not execute targets; "" while it does.

        It is known once that has lasted: an alarm, for example, is shown by the feedback.
        """
        targets = self._targets
        lasts = self._clock.now_ns() - targets.rejected_ns > SILENT_S * NANOSECONDS
        return targets.rejection if lasts else ""

    def forget_rejection(self) -> None:
        """Begin to send targets again, after the arm was switched on."""
        self._targets.rejection = ""

    def _receive(self) -> None:
        """Thread of the feedback: the newest whole packet counts, whatever has queued up."""
        size, data = protocol.FEEDBACK.itemsize, bytearray()
        try:
            while True:
                with suppress(TimeoutError):
                    part = self._feedback.recv(1 << 16)
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
        self._end()
        return self.failure

    def _end(self) -> None:
        self._targets.close()  # and with it targets that are not delivered
        self._commands.close()
        with suppress(OSError):
            self._feedback.shutdown(socket.SHUT_RDWR)

    def _take(self, packet: bytearray) -> None:
        time_ns = self._clock.now_ns()
        fields = np.frombuffer(packet, protocol.FEEDBACK)[0]
        if fields["size"] != len(packet) or fields["test_value"] != protocol.TEST_VALUE:
            raise OperationError("the bytes are not a packet of this protocol")
        position, velocity = fields["position"], fields["velocity"]
        if not (np.abs(position) <= MAX_ANGLE_DEG).all() or not np.isfinite(velocity).all():
            self._implausible = f"positions that no joint has: {position.tolist()}°"
            return  # and a fault where it lasts
        self._implausible = ""
        if not self._know_alarm(bool(fields["error"]), time_ns):
            return
        x, y, z = (1e-3 * fields["load_center_mm"]).tolist()
        self.feedback = Feedback(
            time_ns,
            np.radians(position),
            np.radians(velocity),
            int(fields["mode"]),
            bool(fields["enabled"]),
            bool(fields["dragged"]),
            self._alarm,
            fields["inputs"].tobytes(),
            fields["outputs"].tobytes(),
            MODELS.get(int(fields["model"]), ""),
            Payload(float(fields["load_kg"]), (x, y, z)),
            {"Tool": int(fields["tool_frame"]), "User": int(fields["user_frame"])},
        )
        if self.tool is not None:
            self.tool.poll(time_ns)

    def _know_alarm(self, present: bool, now_ns: int) -> bool:
        """Ask which alarm a packet shows; False: not known yet, and the packet is left out.

        So the alarm and its number appear together. Raises OSError: no answer.
        """
        if not present:
            self._alarm, self._alarm_query = 0, None
        elif not self._alarm:
            if self._alarm_query is None:
                self._alarm_query = self._commands.post(protocol.command("GetErrorID"))
            query = self._alarm_query
            if not self._commands.is_answered(query):
                if now_ns - query.sent_ns > TIMEOUT_S * NANOSECONDS:
                    raise TimeoutError("GetErrorID without a reply")
                return False
            self._alarm = (
                protocol.first_alarm(protocol.parse_reply(query.reply or "", query.name)) or -1
            )
        return True

    @property
    def silence(self) -> str:
        """Reason why no fresh values arrive; "" while they do."""
        if self.failure or self.feedback is None:
            return self.failure or self._implausible or "no feedback yet"
        age_s = (self._clock.now_ns() - self.feedback.time_ns) / NANOSECONDS
        if age_s <= SILENT_S:
            return ""
        return self._implausible or f"no feedback for {age_s:.1f} s"


def switch_off(options: DobotOptions, clock: Clock, timeout_s: float) -> None:
    """Switch the servos off by a connection of its own, where that of a ``ControllerLink`` is lost.

    A controller that does not read now gets the command when it does.
    Raises ConnectError, NotReady, OperationError, DeviceTimeout.
    """
    (connection,) = _connect(options.address, command=options.command_port)
    port = CommandPort(connection, clock, discards=False)
    try:
        protocol.parse_reply(port.call(SWITCH_OFF + "()", timeout_s), SWITCH_OFF)
    except TimeoutError as error:
        raise DeviceTimeout(f"{SWITCH_OFF} without a reply ({error})") from error
    except OSError as error:
        raise NotReady(f"{SWITCH_OFF} without a reply ({error})") from error
    finally:
        port.close()


def _connect(address: str, **ports: int) -> list[socket.socket]:
    """Return a connection to each port. Raises ConnectError, which names all that fail."""
    failures, found = dict[str, str](), list[socket.socket]()
    for name, port in ports.items():
        try:
            found.append(socket.create_connection((address, port), TIMEOUT_S))
        except OSError as error:
            failures[f"{name} port {address}:{port}"] = str(error)
    if failures:
        for connection in found:
            connection.close()
        raise ConnectError("the controller does not answer", failures)
    return found
