"""Recorder of a robot: the flight recorder and the continuous recording."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from robotd.api import NANOSECONDS, OperationError, get_logger, untimed
from robotd.api.features import Event, EventKind, FeatureHost, Tap, why_unwritable
from robotd.api.robots import PacedClock, Robot
from robotd_recorder.continuous_recorder import ContinuousRecorder
from robotd_recorder.feature import RecorderKeys, RecorderSettings
from robotd_recorder.recorder_process import RecorderProcess
from robotd_recording.recording_folder import RecordingFolder, default_folder

log = get_logger("recorder")

MIB = 2**20
ROOM_BYTES = 16 * MIB  # less is of no use to a recording that begins
EARLIER_EVENTS = 20  # from before the first frame: who commanded what
SAVE_TIMEOUT_S = 30.0  # for the process that writes a file
ORIGINS = frozenset(
    {EventKind.COMMAND, EventKind.GOAL, EventKind.RESULT, EventKind.STOP, EventKind.FAULT}
)


class FlightRecorder:
    """Saves a recording after a fault, a stop with a cause, or on request.

    ``check`` belongs to the tap's thread. A file is written by a process of its own, for which a
    thread waits; what fails there is logged, and costs the recording and nothing else.

    Args:
        tap: what is recorded.
        folder: where the files go.
        after_s: time recorded after a fault.

    Attributes:
        saved: number of files written.
        failed: number of recordings lost.
        last: path of the last file; None before the first.
    """

    def __init__(self, tap: Tap, folder: RecordingFolder, after_s: float) -> None:
        self.saved = 0
        self.failed = 0
        self.last: Path | None = None
        self._tap = tap
        self._folder = folder
        self._after_ns = round(after_s * NANOSECONDS)
        self._cursor = 0
        self._was_ready = False
        self._cause: Event | None = None
        self._due_ns = 0
        self._saving = threading.Lock()
        self._thread: threading.Thread | None = None

    def check(self) -> None:
        """Look for a fault among the new events; save when its time has come."""
        events, self._cursor = self._tap.events.since(self._cursor)
        for event in events:
            self._was_ready |= event.kind is EventKind.STATE and event.subject == "device"
            if self._cause is None and self._was_ready and is_trigger(event):
                self._cause, self._due_ns = event, event.time_ns + self._after_ns
        if self._cause is not None and self._tap.robot.clock.now_ns() >= self._due_ns:
            self._begin_saving(self._cause)

    def close(self) -> None:
        """Wait for the file that is being written, then save a fault that is pending."""
        self._join()
        if self._cause is not None:
            self._begin_saving(self._cause)
            self._join()

    def snapshot(self, reason: str) -> Path:
        """Save now; return the file. Any worker thread; blocks for about a second.

        Raises OperationError: it could not be written.
        """
        mark = self._tap.events.add(EventKind.MARK, "snapshot", reason)
        if not self._saving.acquire(timeout=SAVE_TIMEOUT_S):
            raise OperationError("another recording is still being written")
        try:
            return self._save("snapshot", mark)
        except OSError as error:
            raise OperationError(f"the recording was not written: {error}") from error
        finally:
            self._saving.release()

    def _join(self) -> None:
        if self._thread is not None:
            self._thread.join(SAVE_TIMEOUT_S)

    def _begin_saving(self, cause: Event) -> None:
        if self._thread is not None and self._thread.is_alive():
            return  # it is tried again
        self._cause = None
        self._thread = threading.Thread(
            target=self._save_or_log, args=(cause,), name="robotd-recorder", daemon=True
        )
        self._thread.start()

    def _save_or_log(self, cause: Event) -> None:
        with self._saving:
            try:
                path = self._save(str(cause.kind), cause)
                log.warning("recording saved", file=str(path), cause=cause.text)
            except OSError as error:
                self.failed += 1
                log.error(
                    "recording lost", folder=str(self._folder.path), reason=error.strerror or error
                )
            except Exception:
                self.failed += 1
                log.exception("recording lost")

    def _save(self, word: str, cause: Event) -> Path:
        tap = self._tap
        clock = tap.robot.clock
        # Where it passes faster than real time the frames of the cause would be overwritten before
        # the process reads them; else a busy computer, on which that takes 30 s, would hold up the
        # robot as long.
        is_fast = isinstance(clock, PacedClock) and clock.scale > 1.0
        with (
            untimed(clock) if is_fast else nullcontext(),
            RecorderProcess(tap, self._folder, word, cause) as process,
        ):
            events = _recent(tap.events.since(0)[0], tap.frames.oldest_ns)
            process.send(events, tap.samples.since(0)[0])
            report = process.finish(SAVE_TIMEOUT_S)
        self.saved += 1
        self.last = report.path
        return report.path or self._folder.path


def is_trigger(event: Event) -> bool:
    """Return True for an event that a recording is saved for."""
    if event.kind is EventKind.COMMAND:
        return event.subject == "quick_stop" and event.data.get("outcome") == "accepted"
    if event.kind is EventKind.RESULT and event.data.get("outcome") == "stopped":
        return False  # the stop is an event of its own
    is_own = event.kind is EventKind.LOG and event.subject == "recorder"
    return event.is_bad and not is_own


def _recent(events: list[Event], oldest_ns: int) -> list[Event]:
    """Return events of the frames' time, and the last ones from before that explain them."""
    events = sorted(events, key=lambda event: event.time_ns)
    earlier = [event for event in events if event.time_ns < oldest_ns and event.kind in ORIGINS]
    return [*earlier[-EARLIER_EVENTS:], *(event for event in events if event.time_ns >= oldest_ns)]


@dataclass(frozen=True)
class Recorder:
    """Recorder of one robot.

    Attributes:
        tap: source of everything.
        flight: saves the last seconds.
        continuous: records from a start to a stop.
    """

    tap: Tap
    flight: FlightRecorder
    continuous: ContinuousRecorder


@contextmanager
def open_recorder(host: FeatureHost) -> Iterator[Recorder | None]:
    """Run the recorder of a robot whose file enables it. Main thread.

    Raises OperationError: the continuous recording does not start, or has no folder to write to.
    """
    keys = host.robot.descriptor.settings(RecorderKeys)
    if keys.recorder.enabled or keys.record is not None:
        with _record(host, keys) as recorder:
            yield recorder
    else:
        yield None


@contextmanager
def observed(robot: Robot, flight_folder: Path) -> Iterator[Recorder]:
    """Record a robot that is not started, without its other features. Main thread."""
    host = FeatureHost(robot, (), "/", print)
    keys = RecorderKeys(recorder=RecorderSettings(folder=flight_folder))
    with _record(host, keys) as recorder, recorder.tap:
        yield recorder


@contextmanager
def _record(host: FeatureHost, keys: RecorderKeys) -> Iterator[Recorder]:
    settings, name = keys.recorder, host.robot.descriptor.name
    folder = settings.folder or default_folder()
    keep_bytes = settings.keep_mib * MIB
    kept = RecordingFolder(folder, name, settings.keep_files, keep_bytes)
    recorded = RecordingFolder(keys.record or folder, name, settings.keep_files, keep_bytes)
    if keys.record is not None and (reason := why_unwritable(recorded.path, ROOM_BYTES)):
        raise OperationError(f"nothing can be recorded to {reason}")
    if settings.enabled and (reason := why_unwritable(kept.path, ROOM_BYTES)):
        log.warning("the flight recorder cannot save recordings", folder=reason)
    tap = host.tap(settings.seconds)
    flight = FlightRecorder(tap, kept, settings.after_s)
    world = host.robot.world
    cameras = world.cameras if settings.cameras and world is not None else ()
    continuous = ContinuousRecorder(
        tap, recorded, settings.split_mib * MIB, settings.split_s, cameras
    )
    tap.add_reader(flight.check)
    try:
        if keys.record is not None:
            continuous.start()
        yield Recorder(tap, flight, continuous)
    finally:
        continuous.close()
        flight.close()
