"""Connection: life cycle of one device with retries, and its readiness."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from robotd.clean_up import run_all
from robotd.descriptor import EngineSettings
from robotd.descriptor.files import is_file
from robotd.device.drivers import DeviceDriver
from robotd.device.state import COMMUNICATES, ConnectionState
from robotd.errors import (
    ConnectError,
    DescriptorError,
    NotReady,
    OperationError,
    RobotdError,
    Unsupported,
)
from robotd.log import get_logger

log = get_logger("connection")

ReadyListener = Callable[[bool], None]

STATE_TIMEOUT_S = 1.0  # longest wait for a device that another thread is asking for its state
REPORT_INTERVAL_S = 5.0  # of a start-up step that takes long
ENDING = "the robot is being shut down: nothing is started or switched on any more"
STOPPING = "communication is being stopped: nothing is started any more"


class StartupStep:
    """Name and duration of the step that a start-up is in. Any thread reads.

    One thread at a time enters ``running``; a step within a step replaces it until it ends.
    """

    def __init__(self, report_interval_s: float = REPORT_INTERVAL_S) -> None:
        self._report_interval_s = report_interval_s
        self._step: tuple[str, float] | None = None

    @property
    def text(self) -> str:
        """Describe the running step as "starting communication for 12 s"; or ""."""
        step = self._step
        return f"{step[0]} for {time.monotonic() - step[1]:.0f} s" if step else ""

    @contextmanager
    def running(self, name: str) -> Iterator[None]:
        """Run the block as step ``name``, with a log line every ``report_interval_s``."""
        before, self._step = self._step, (name, time.monotonic())
        ended = threading.Event()
        reporting = threading.Thread(
            target=self._report, args=(name, ended), name="robotd-startup-step", daemon=True
        )
        reporting.start()
        try:
            yield
        finally:
            self._step = before
            ended.set()
            reporting.join()

    def _report(self, name: str, ended: threading.Event) -> None:
        passed_s = 0.0
        while not ended.wait(self._report_interval_s):
            passed_s += self._report_interval_s
            log.warning("start-up takes long", step=name, for_s=passed_s)


class Connection:
    """Opens, starts, stops and closes a device; the only caller of ``DeviceDriver``.

    Every method may be called by any thread; commands exclude each other, ``state`` and
    ``ready`` never block. Nothing here enables a servo. Listeners are called one at a time, and
    must not command the engine.

    Attributes:
        before_stop: called before communication is stopped on purpose: brings motion to rest.
        scaling_lock: held while the scale of axes may change.
        ready: axes can be commanded: communicating, parameters in force, values fresh.
            Communication that ``start_communication`` has not brought about does not count.
        established: True from the end of ``start_communication`` until it is stopped on purpose.
            While it is, a device that is not ready has been lost.
        stale: values of the device are too old to be trusted.
        begun: how often communication has begun.
        parameters_file: applied whenever communication starts on a newly opened device; None leaves
            the device's own parameters.
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
        self.settings = settings
        self.ready = self.established = self.stale = False
        self.begun = 0
        self.scaling_lock = threading.Lock()
        self._driver = driver
        self._backend = backend
        self.parameters_file, self._has_parameters = parameters_file, has_parameters
        self._parameters_applied = False  # since the device was opened
        self._lock = threading.RLock()
        self._ending = threading.Event()
        self._closed = False
        self.step = StartupStep()
        self._stale_reason = ""
        self._hang = ""
        self._start_failure = ""
        self._wanted = False  # communication should run
        self._stopping = False  # from before motion is brought to rest until it is not ready
        self._listeners: list[ReadyListener] = []
        # One thread at a time: else an older answer of the device could overwrite a newer one.
        self._ready_lock = threading.RLock()
        self.before_stop: Callable[[], None] = lambda: None  # the robot puts its own stop here

    @property
    def state(self) -> ConnectionState:
        """The device's state; UNKNOWN while its values are stale, SHUTDOWN for good at the end."""
        if self._closed:
            return ConnectionState.SHUTDOWN
        state = self._driver.state()
        stale = self.stale and state is ConnectionState.COMMUNICATING
        return ConnectionState.UNKNOWN if stale else state

    @property
    def ending(self) -> bool:
        """True once ``abort_start`` or ``shutdown`` was called."""
        return self._ending.is_set()

    @property
    def commandable(self) -> bool:
        """True while motion may start: ready, and no request to end or to stop has come."""
        return self.ready and not self._stopping and not self._ending.is_set()

    @property
    def rejection(self) -> str:
        """Reason for rejecting axis commands while ``commandable`` is False."""
        if self._ending.is_set():
            return ENDING
        if self._stopping:
            return STOPPING
        text, reason = f"engine is not ready (state {self.state.value})", self.reason
        return f"{text}: {reason}" if reason else text

    @property
    def reason(self) -> str:
        """Reason for not being ready: the start-up step or the fault; may be ""."""
        return self.fault if self.established else self.step.text or self.fault

    @property
    def lost(self) -> bool:
        """True while communication should run and axes cannot be commanded."""
        return self._wanted and not self.ready and not self._ending.is_set()

    @property
    def fault(self) -> str:
        """Reason for the lack of communication; "" if there is none."""
        if self._hang:
            return self._hang
        if self.state is ConnectionState.COMMUNICATING:
            if self.established or self.ready:
                return ""
            if self._start_failure:
                return f"it communicates although its start failed: {self._start_failure}"
            return "communication was not started by robotd, so its parameters are not in force"
        failed = f"the last start failed: {self._start_failure}" if self._start_failure else ""
        return self.ask_fault() or failed or self._stale_reason

    def ask_fault(self) -> str:
        """Return the device's own fault; "" for none.

        A worker asks once before the control loop starts: that asks no device that hangs.
        """
        try:
            return self._driver.fault()
        except Exception as error:  # noqa: BLE001 - of a plugin; the state itself is known
            return f"{type(error).__name__}: {error}"

    def require_ready(self) -> None:
        """Raise NotReady, with the reason, unless axes can be commanded."""
        if not self.ready:
            raise NotReady(self.rejection)

    def require_alive(self) -> None:
        """Raise NotReady once the robot is asked to end: nothing is started or switched on."""
        if self._ending.is_set():
            raise NotReady(ENDING)

    def on_ready(self, listener: ReadyListener) -> None:
        """Call ``listener(ready)`` now and on every change, from the thread that causes it."""
        with self._ready_lock:
            self._listeners.append(listener)
            listener(self.ready)

    def start(self) -> None:
        """Open with retries, scan, and start communication.

        Raises the last error when every try has failed, or after one that is permanent; returns
        early when it is asked to end.
        """
        self._wanted, tries = True, self.settings.open_tries
        for attempt in range(1, tries + 1):
            try:
                with self.step.running(f"opening the device, try {attempt} of {tries}"):
                    self.open()
                break
            except ConnectError as error:
                if error.permanent:
                    raise
                log.warning("open failed", attempt=attempt, of=tries, reason=str(error))
                if attempt == tries:
                    raise
            if self._ending.wait(self.settings.open_retry_s):
                return
        with self.step.running("scanning the fieldbus"):
            network = self.scan_network()
        log.info("fieldbus scanned", network=network)
        if not self._ending.is_set():
            self.start_communication()

    def open(self, path: str = "", name: str = "") -> None:
        """Connect to the device. An open device with no other path asked for: no effect."""
        with self._lock:
            self.require_alive()
            if self._driver.state() is not ConnectionState.IDLE:
                if path:
                    raise NotReady(f"device is open already; close it before opening {path!r}")
                return
            try:
                self._driver.open(path, name)
            except Exception as error:
                self._start_failure = str(error)
                raise
            self._start_failure = ""
            self._parameters_applied = False
            log.info("device open", backend=self._backend)

    def close(self) -> None:
        """Stop communication and disconnect, from any state."""
        with self._lock:
            run_all(self.stop_communication, self._close_driver, self.update_ready)

    def _close_driver(self) -> None:
        self._driver.close()
        log.info("device closed")

    def restore(self) -> None:
        """Open the device and start communication, as far as they are missing. One try.

        Nothing moves, no servo is switched on. Raises the errors of ``open`` and
        ``start_communication``.
        """
        with self._lock:
            try:
                if self._driver.state() is ConnectionState.SHUTDOWN:  # ended by another program
                    self.close()
                self.open()
                self.start_communication()
            finally:
                self._wanted = True  # ``close`` ends that, and a step that failed is tried again

    def restore_if_lost(self) -> None:
        """Restore a connection that is still ``lost`` when no other command runs."""
        with self._lock:
            if self.lost:
                self.restore()

    def start_communication(self) -> None:
        """Begin the cyclic exchange and apply the parameter file. Nothing moves.

        Already communicating: no effect. A start that fails is undone: communication is stopped
        where it was not running before, and what begins to communicate later is not ready.
        """
        with self._lock:
            self.require_alive()
            self._wanted = True
            if self._driver.state() is ConnectionState.IDLE:
                raise NotReady("device is not open")
            path = self.parameters_file
            if path is not None and self._has_parameters and not is_file(path):
                raise DescriptorError("parameter file does not exist", path=path)
            try:
                self._begin_communication()
                self._start_failure = ""
            except Exception as error:
                self._start_failure = str(error)
                raise
            finally:
                self.update_ready()
            log.info("communication started")

    def stop_communication(self) -> None:
        """End the cyclic exchange after ``before_stop``; servos go off.

        Not communicating: no effect.
        """
        with self._lock:
            try:
                if self._driver.state() in COMMUNICATES:
                    self._stopping = True
                    run_all(self.before_stop, self._end_exchange)
                    log.info("communication stopped")
            finally:
                self.established, self._wanted, self._start_failure = False, False, ""
                self.update_ready()
                self._stopping = False

    def _end_exchange(self) -> None:
        self.established = False
        self._driver.stop_communication(self.settings.communication_timeout_s)

    def scan_network(self) -> str:
        """Scan the fieldbus; return a one-line summary for people."""
        with self._lock:
            if self._driver.state() is ConnectionState.IDLE:
                raise NotReady("device is not open")
            return self._driver.scan_network()

    def load_parameters(self, path: Path) -> str:
        """Apply a parameter file now, all of it or nothing. The file must exist.

        Returns the driver's note: what the file leaves out, "" where that is nothing. Raises
        what ``DeviceDriver.load_parameters`` does.
        """
        self._require_parameters()
        if not is_file(path):
            raise OperationError(f"parameter file {path} does not exist, or is not a file")
        with self._lock:
            self.require_ready()
            return self._load_parameters(path)

    def apply_parameters(self) -> None:
        """Load the descriptor's file, once after each opening. Part of ``start_communication``."""
        with self._lock:
            path = self.parameters_file
            if path is not None and self._has_parameters and not self._parameters_applied:
                with self.step.running("loading parameters"):
                    self._load_parameters(path)
                self._parameters_applied = True

    def dump_parameters(self, axis: int) -> str:
        """Return the parameters of one axis in force, as text for people."""
        self._require_parameters()
        return self._driver.dump_parameters(axis)

    def abort_start(self) -> None:
        """Begin no try, start, motion or servo-on any more: the robot is asked to end.

        Any thread; stops are accepted as before.
        """
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

    def set_stale(self, stale: bool, reason: str = "") -> None:
        """Note that the device's values are stale, and why, or fresh again. Control-loop thread."""
        self._hang, self._stale_reason = "", reason
        if stale is not self.stale:
            self.stale = stale
            self.update_ready()

    def abandon(self, reason: str) -> None:
        """Reject commands while the control loop hangs, without asking the device. Watchdog.

        A period that goes on after all calls ``set_stale``.
        """
        self.stale, self._hang = True, reason
        self._set_ready(False)  # without the lock: its holder may hang

    def update_ready(self) -> ConnectionState:
        """Recompute ``ready`` from the device's state, which is returned.

        UNKNOWN, without effect, when another thread gets no answer.
        """
        if not self._ready_lock.acquire(timeout=STATE_TIMEOUT_S):
            return ConnectionState.UNKNOWN
        try:
            state = self.state
            self._set_ready(state is ConnectionState.COMMUNICATING and self.established)
            return state
        finally:
            self._ready_lock.release()

    def _set_ready(self, ready: bool) -> None:
        """Call the listeners on a change; what one raises is logged."""
        if ready is self.ready:
            return
        self.ready = ready
        for listener in self._listeners:
            try:
                listener(ready)
            except Exception:
                log.exception("a listener of the engine failed", ready=ready)

    def _begin_communication(self) -> None:
        before = self._driver.state()
        if self.established and before is ConnectionState.COMMUNICATING:
            return
        self.established = False
        self.update_ready()  # a loss that nobody has noticed yet rejects motion as well
        try:
            if before is not ConnectionState.COMMUNICATING:
                self.begun += 1
                if self._driver.parameters_before_communication:
                    self.apply_parameters()
                with self.step.running("starting communication"):
                    self._driver.start_communication(self.settings.communication_timeout_s)
            self.require_alive()
            self.apply_parameters()
        except Exception:
            # A device that partly communicated, or for other programs, goes on as before.
            if before is ConnectionState.RUNNING:
                try:
                    self._driver.stop_communication(self.settings.communication_timeout_s)
                except RobotdError as error:
                    log.error("the failed start could not be undone", reason=str(error))
            raise
        self.established = True

    def _load_parameters(self, path: Path) -> str:
        """Load a file, all of it or nothing; return the driver's note, may be ""."""
        with self.scaling_lock:
            note = self._driver.load_parameters(path) or ""  # None of a driver that has none
        if note:
            log.warning("parameters loaded", file=str(path), note=note)
        else:
            log.info("parameters loaded", file=str(path))
        return note

    def _require_parameters(self) -> None:
        if not self._has_parameters:
            raise Unsupported("parameter files", self._backend)
