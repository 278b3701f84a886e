"""The devices of one robotd on the engine, and which thread owns which.

The SDK wants one device per thread: calls on a shared one wait for each other. A call that
takes long must not hold up a stop, so there is one device for each kind of caller:

- ``status``: the control loop, and I/O reads; answers from memory only, never blocks.
- ``command``: worker threads; every call is short; waiting threads poll the status.
- ``stream``: the threads that send streamed velocities and positions.
- ``diagnostics``: EtherCAT calls, which may take seconds.

Losing the engine is final for a connection: its parameters are gone even if another program
starts the engine again, so nothing is commanded through it any more. A new connection starts anew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robotd.api import (
    NANOSECONDS,
    Clock,
    ConnectError,
    ConnectionState,
    NotReady,
    RobotDescriptor,
    get_logger,
)
from robotd_wmx import _native
from robotd_wmx._native import CallError, Device, State
from robotd_wmx.errors import LOCKED, name_of, text_of
from robotd_wmx.options import WmxOptions
from robotd_wmx.scaling import Scaling

log = get_logger("wmx")

ROLES = ("command", "status", "stream", "diagnostics")
LOCK_RETRY_NS = 200_000_000
_STATES = {
    State.IDLE: ConnectionState.UNKNOWN,  # still initialising, although we have a device
    State.RUNNING: ConnectionState.RUNNING,
    State.COMMUNICATING: ConnectionState.COMMUNICATING,
    State.SHUTDOWN: ConnectionState.SHUTDOWN,
    State.UNKNOWN: ConnectionState.UNKNOWN,
}


class WmxConnection:
    """All devices, opened and closed together. Nothing is opened by the constructor."""

    def __init__(self, robot: RobotDescriptor, options: WmxOptions, clock: Clock) -> None:
        self.robot = robot
        self.options = options
        self.clock = clock
        self.scaling = Scaling(robot, options)
        self._devices: dict[str, Device] = {}
        self._name = ""  # of the devices
        self._lost = False
        self._lost_because = ""
        self._after_open: list[Callable[[], None]] = []
        self._before_close: list[Callable[[], None]] = []
        self._after_read: list[Callable[[Device], None]] = []

    @property
    def is_open(self) -> bool:
        return bool(self._devices)

    @property
    def command(self) -> Device:
        """Raises NotReady without an open device, like the three that follow."""
        return self._device("command")

    @property
    def status(self) -> Device:
        return self._device("status")

    @property
    def stream(self) -> Device:
        return self._device("stream")

    @property
    def diagnostics(self) -> Device:
        return self._device("diagnostics")

    def open(self, path: str, name: str) -> None:
        """Create all devices, the first of which starts the engine unless it runs.

        Raises ConnectError; nothing stays open then.
        """
        path = path or self.options.sdk_path or _native.SDK_PATH
        path = path if path.endswith("/") else path + "/"
        opened: dict[str, Device] = {}
        try:
            for role in ROLES:
                opened[role] = self._create(path, _name_of(name, role))
        except CallError as error:
            for device in opened.values():
                _close_quietly(device, keep_engine=False)
            call, api, code, _, text = error.args
            reason = f"{text_of(api, code, text)} from {call}"
            failure = ConnectError(f"the WMX engine does not open on device {path!r}",
                                   {f"{self.robot.name} → wmx": reason})  # fmt: skip
            failure.code = code
            raise failure from error
        self._lost = False
        self._devices, self._name = opened, name

    def after_open(self, call: Callable[[], None]) -> None:
        """Call ``call`` in ``prepare``."""
        self._after_open.append(call)

    def prepare(self) -> None:
        """Allocate what is needed for as long as the devices are open. Raises RobotdError."""
        for call in self._after_open:
            call()

    def after_read(self, call: Callable[[Device], None]) -> None:
        """Call ``call`` with the device of the status in ``was_read``."""
        self._after_read.append(call)

    def was_read(self, device: Device) -> None:
        """Call what ``after_read`` has added; the axes of this period were read. Control loop."""
        for call in self._after_read:
            call(device)

    def before_close(self, call: Callable[[], None]) -> None:
        """Call ``call`` in ``prepare_close``."""
        self._before_close.append(call)

    def prepare_close(self) -> None:
        """End what uses the engine in threads of its own, before the engine is stopped."""
        for call in self._before_close:
            call()

    def close(self) -> None:
        """Close all devices; the engine stops with the last one of all programs."""
        devices, self._devices = self._devices, {}
        for role in reversed(ROLES):
            if role in devices:
                _close_quietly(devices[role], keep_engine=self.options.shared)

    def state(self) -> ConnectionState:
        """Never blocks, never raises; IDLE without devices. A lost engine stays SHUTDOWN."""
        device = self._devices.get("status")
        if device is None:
            return ConnectionState.IDLE
        if not self._lost:
            try:
                state = _STATES[device.state()]
            except CallError as error:
                self._lose(f"the engine is gone: {text_of(*error.args[1:3])}")
            else:
                if state is not ConnectionState.SHUTDOWN:
                    return state
                self._lose("the engine was stopped by another program")
        return ConnectionState.SHUTDOWN

    def lost_because(self) -> str:
        """Reason for the loss of the engine; "" while it is connected."""
        return self._lost_because if self._devices and self._lost else ""

    def give_up(self) -> None:
        """The engine is about to be stopped by us: nothing is commanded any more."""
        self._lost, self._lost_because = True, ""

    def others(self) -> list[str]:
        """Names of other programs' devices; empty when the engine does not report them."""
        try:
            mine = {device.id() for device in self._devices.values()}
            return [
                name or f"device {number}"
                for number, name in self.command.devices()
                if number not in mine
            ]
        except CallError:
            return []

    def predecessors(self) -> list[str]:
        """Names of other devices that are named as ours: of another robotd of this robot."""
        ours = {_name_of(self._name, role) for role in ROLES}
        return [name for name in self.others() if name in ours]

    def _device(self, role: str) -> Device:
        device = self._devices.get(role)
        if device is None:
            raise NotReady("no device of the WMX engine is open")
        if self._lost:
            reason = self._lost_because or "the engine is Shutdown"
            raise NotReady(f"{reason}; close the device and open it again")
        return device

    def _lose(self, reason: str) -> None:
        self._lost, self._lost_because = True, reason
        log.debug("engine lost", reason=reason)  # the core reports the loss of a device

    def _create(self, path: str, name: str) -> Device:
        for last in self._attempts():
            device = Device()
            try:
                device.create(path, round(self.options.engine_timeout_s * 1000))
                device.set_name(name)
                device.set_watchdog(round(self.options.watchdog_s * 1000))
            except CallError as error:
                _close_quietly(device, keep_engine=False)
                if last or name_of(error) not in LOCKED:
                    raise
                log.warning("engine locked, trying again", reason=text_of(*error.args[1:3]))
            else:
                return device
        raise AssertionError("the last attempt returns or raises")

    def _attempts(self) -> Iterator[bool]:
        """False for every attempt, then True for the last one, LOCK_RETRY_NS apart."""
        end_ns = self.clock.now_ns() + round(self.options.lock_timeout_s * NANOSECONDS)
        while self.clock.now_ns() + LOCK_RETRY_NS < end_ns:
            yield False
            self.clock.sleep_until_ns(self.clock.now_ns() + LOCK_RETRY_NS)
        yield True


def _name_of(name: str, role: str) -> str:
    return name if role == "command" else f"{name}.{role}"


def _close_quietly(device: Device, *, keep_engine: bool) -> None:
    """A device that cannot be closed is gone already; that is all that is wanted."""
    try:
        device.close(keep_engine)
    except CallError as error:
        log.debug("closing a device failed", reason=text_of(*error.args[1:3]))
