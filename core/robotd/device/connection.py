"""The engine: life cycle of one device, with retries, and whether it is ready to command."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from robotd.descriptor import EngineSettings
from robotd.descriptor.files import is_file
from robotd.device.drivers import DeviceDriver
from robotd.device.state import ConnectionState
from robotd.errors import (
    ConnectError,
    DescriptorError,
    NotReady,
    OperationError,
    RobotdError,
    Unsupported,
)
from robotd.log import get_logger

log = get_logger("engine")

ReadyListener = Callable[[bool], None]

ANSWER_S = 1.0  # longest wait for a device that another thread is asking for its state


class Connection:
    """Opens, starts, stops and closes a device; the only caller of ``DeviceDriver``.

    Every method may be called by any thread; commands exclude each other, ``state`` and
    ``ready`` never block. Nothing here enables a servo. Listeners are called one at a time, and
    must not command the engine.

    Attributes:
        before_stop: called before communication is stopped on purpose: brings motion to rest.

    Args:
        driver: the backend's device, not connected yet.
        settings: tries, time-outs and ages from the descriptor.
        parameters_file: applied whenever communication starts on a newly opened device;
            None leaves the device's own parameters.
        backend: name used in error texts.
    """

    def __init__(
        self,
        driver: DeviceDriver,
        settings: EngineSettings,
        parameters_file: Path | None,
        backend: str,
        *,
        has_parameters: bool = True,
    ) -> None:
        self.parameters_file = parameters_file
        self.settings = settings
        self._driver = driver
        self._backend = backend
        self._has_parameters = has_parameters
        self._parameters_loaded = False
        self._lock = threading.RLock()
        self._ending = threading.Event()
        self._closed = False
        self._stale = False
        self._hang = ""
        self._preparing = False
        self._ready = False
        self._ready_lock = threading.RLock()
        self._listeners: list[ReadyListener] = []
        self.before_stop: Callable[[], None] = _nothing

    @property
    def state(self) -> ConnectionState:
        """The device's state; UNKNOWN while its values are stale, SHUTDOWN for good at the end."""
        if self._closed:
            return ConnectionState.SHUTDOWN
        state = self._driver.state()
        return (
            ConnectionState.UNKNOWN
            if self._stale and state is ConnectionState.COMMUNICATING
            else state
        )

    @property
    def ready(self) -> bool:
        """True while axes can be commanded: communicating, parameters in force, values fresh."""
        return self._ready

    @property
    def rejection(self) -> str:
        """Why axes cannot be commanded, for whoever tried while ``ready`` is False."""
        text, fault = f"engine is not ready (state {self.state.value})", self.fault
        return f"{text}: {fault}" if fault else text

    @property
    def fault(self) -> str:
        """Why the device does not communicate, in words; "" if it does, or cannot say."""
        if self._hang:
            return self._hang
        try:
            return "" if self.state is ConnectionState.COMMUNICATING else self._driver.fault()
        except Exception as error:  # noqa: BLE001 - of a plugin; the state itself is known
            return f"{type(error).__name__}: {error}"

    def require_ready(self) -> None:
        """Raise NotReady, with the reason, unless axes can be commanded."""
        if not self._ready:
            raise NotReady(self.rejection)

    def on_ready(self, listener: ReadyListener) -> None:
        """Call ``listener(ready)`` now and on every change, from the thread that causes it."""
        with self._ready_lock:
            self._listeners.append(listener)
            listener(self._ready)

    def start(self) -> None:
        """The whole start-up: open with retries, scan, start communication.

        Raises the last error when every try has failed; returns early after ``shutdown``.
        """
        tries = self.settings.open_tries
        for attempt in range(1, tries + 1):
            try:
                self.open()
                break
            except ConnectError as error:
                log.warning("open failed", attempt=attempt, of=tries, reason=str(error))
                if attempt == tries:
                    raise
            if self._ending.wait(self.settings.open_retry_s):
                return
        log.info("fieldbus scanned", network=self.scan_network())
        self.start_communication()

    def open(self, path: str = "", name: str = "") -> None:
        """Connect to the device. An open device with no other path asked for: no effect."""
        with self._lock:
            self._require_alive()
            if self._driver.state() is not ConnectionState.IDLE:
                if path:
                    raise NotReady(f"device is open already; close it before opening {path!r}")
                return
            self._driver.open(path, name)
            self._parameters_loaded = False
            log.info("device open", backend=self._backend)

    def close(self) -> None:
        """Stop communication and disconnect, from any state."""
        with self._lock:
            try:
                self.stop_communication()
            finally:
                try:
                    self._driver.close()
                    log.info("device closed")
                finally:
                    self.update_ready()

    def start_communication(self) -> None:
        """Begin the cyclic exchange and apply the parameter file. Nothing moves."""
        with self._lock:
            self._require_alive()
            if self._driver.state() is ConnectionState.IDLE:
                raise NotReady("device is not open")
            self._check_parameters_file()
            self._preparing = not self._ready
            try:
                self._begin_communication()
            finally:
                self._preparing = False
                self.update_ready()
            log.info("communication started")

    def stop_communication(self) -> None:
        """End the cyclic exchange after ``before_stop``; servos go off.

        Not communicating: no effect.
        """
        with self._lock:
            try:
                if self._driver.state() in (ConnectionState.COMMUNICATING, ConnectionState.UNKNOWN):
                    self._end_communication()
                    log.info("communication stopped")
            finally:
                self.update_ready()

    def scan_network(self) -> str:
        """Look for devices on the fieldbus; a one-line summary for people."""
        with self._lock:
            if self._driver.state() is ConnectionState.IDLE:
                raise NotReady("device is not open")
            return self._driver.scan_network()

    def load_parameters(self, path: Path) -> None:
        """Apply a parameter file now, all of it or nothing. The file must exist."""
        if not self._has_parameters:
            raise Unsupported("parameter files", self._backend)
        if not is_file(path):
            raise OperationError(f"parameter file {path} does not exist, or is no file")
        with self._lock:
            self.require_ready()
            self._driver.load_parameters(path)
            log.info("parameters loaded", file=str(path))

    def dump_parameters(self, axis: int) -> str:
        """The parameters of one axis in force, as text for people."""
        if not self._has_parameters:
            raise Unsupported("parameter files", self._backend)
        return self._driver.dump_parameters(axis)

    def abort_start(self) -> None:
        """End a start-up that is waiting for its next try, and allow no further command."""
        self._ending.set()

    def shutdown(self) -> None:
        """Close the device for good, SHUTDOWN whatever happens. Twice is not an error."""
        self._ending.set()
        with self._lock:
            try:
                self.close()
            finally:
                self._closed = True
                self.update_ready()

    def set_stale(self, stale: bool) -> None:
        """Cycle thread: the device's values are (no longer) too old to be trusted."""
        self._hang = ""
        if stale is not self._stale:
            self._stale = stale
            self.update_ready()

    def abandon(self, reason: str) -> None:
        """Watchdog: the cycle hangs in the driver. Not ready, without asking the device.

        A cycle that goes on after all says by ``set_stale`` how old the values are.
        """
        self._stale, self._hang = True, reason
        if self._ready:
            self._ready = False
            for listener in self._listeners:
                _tell(listener, False)

    def update_ready(self) -> ConnectionState:
        """Recompute ``ready`` from the device's state and tell the listeners of a change.

        Returns the state. What a listener raises is logged.
        """
        # One thread at a time: else an older answer of the device could overwrite a newer one.
        if not self._ready_lock.acquire(timeout=ANSWER_S):
            return ConnectionState.UNKNOWN  # whoever asks does not get an answer either
        try:
            state = self.state
            ready = state is ConnectionState.COMMUNICATING and not self._preparing
            if ready is not self._ready:
                self._ready = ready
                for listener in self._listeners:
                    _tell(listener, ready)
            return state
        finally:
            self._ready_lock.release()

    def _begin_communication(self) -> None:
        if self._driver.state() is not ConnectionState.COMMUNICATING:
            self._driver.start_communication(self.settings.communication_timeout_s)
        try:
            self._apply_parameters_file()
        except RobotdError:
            self._driver.stop_communication(self.settings.communication_timeout_s)
            raise

    def _end_communication(self) -> None:
        try:
            self.before_stop()
        finally:
            self._driver.stop_communication(self.settings.communication_timeout_s)

    def _require_alive(self) -> None:
        if self._ending.is_set():
            raise NotReady("engine is shut down")

    def _check_parameters_file(self) -> None:
        path = self.parameters_file
        if path is not None and self._has_parameters and not is_file(path):
            raise DescriptorError("parameter file does not exist", path=path)

    def _apply_parameters_file(self) -> None:
        if self.parameters_file is None or self._parameters_loaded or not self._has_parameters:
            return
        self._driver.load_parameters(self.parameters_file)
        self._parameters_loaded = True
        log.info("parameters loaded", file=str(self.parameters_file))


def _tell(listener: ReadyListener, ready: bool) -> None:
    try:
        listener(ready)
    except Exception:
        log.exception("a listener of the engine failed", ready=ready)


def _nothing() -> None:
    """The robot that owns the engine puts its own stop here."""
