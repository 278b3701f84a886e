"""Recorder of a robot: the flight recorder and the continuous recording."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from robotd.api import OperationError, get_logger
from robotd.api.features import FeatureHost, Tap, why_unwritable
from robotd.api.robots import Robot
from robotd_recorder.continuous_recorder import ContinuousRecorder
from robotd_recorder.feature import RecorderKeys, RecorderSettings
from robotd_recorder.flight_recorder import FlightRecorder
from robotd_recording.recording_folder import RecordingFolder, default_folder

log = get_logger("recorder")

MIB = 2**20
ROOM_BYTES = 16 * MIB  # less is of no use to a recording that begins


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
    """Run the recorder of a robot that wants one. Main thread.

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
