"""Recorder of a robot: the tap, the flight recorder and the continuous recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from robotd.errors import OperationError
from robotd.log import get_logger
from robotd.observation.tap import Tap
from robotd.robot import Robot
from robotd_recorder.continuous_recorder import ContinuousRecorder
from robotd_recorder.flight_recorder import FlightRecorder
from robotd_recording.recording_folder import RecordingFolder, default_folder

log = get_logger("recorder")

MIB = 2**20


@dataclass(frozen=True)
class Recorder:
    """Observation of one robot.

    Attributes:
        tap: source of everything.
        flight: saves the last seconds.
        continuous: records from a start to a stop.
        metrics: returns the text of the metrics; None without prometheus_client, and where
            they are not served.
    """

    tap: Tap
    flight: FlightRecorder
    continuous: ContinuousRecorder
    metrics: Callable[[], bytes] | None = None


@contextmanager
def observed(
    robot: Robot,
    *,
    flight_folder: Path | None = None,
    record_folder: Path | None = None,
    metrics_port: int | None = None,
    count_metrics: bool = False,
) -> Iterator[Recorder]:
    """Observe a robot that is not started until the block ends. Main thread.

    Args:
        robot: with the settings of the flight recorder in its descriptor.
        flight_folder: replaces the descriptor's; None: not replaced.
        record_folder: record continuously there, from now on; None: when it is requested, and in
            the folder of the flight recorder.
        metrics_port: serve metrics there, on the loopback interface; 0: any port; None: none.
        count_metrics: for ``Recorder.metrics``, where prometheus_client is installed.

    Raises OperationError: the continuous recording or the metrics do not start.
    """
    settings, name = robot.descriptor.recorder, robot.descriptor.name
    folder = flight_folder or settings.folder or default_folder()
    keep_bytes = settings.keep_mib * MIB
    kept = RecordingFolder(folder, name, settings.keep_files, keep_bytes)
    recorded = RecordingFolder(record_folder or folder, name, settings.keep_files, keep_bytes)
    tap = Tap(robot, settings.seconds)
    flight = FlightRecorder(tap, kept, settings.after_s)
    continuous = ContinuousRecorder(tap, recorded, settings.split_mib * MIB, settings.split_s)
    tap.add_reader(flight.check)
    with ExitStack() as stack:
        metrics = None
        if metrics_port is not None or count_metrics:
            metrics = _metrics(tap, flight, metrics_port, stack)
        stack.enter_context(tap)
        try:
            if record_folder is not None:
                continuous.start()
            yield Recorder(tap, flight, continuous, metrics)
        finally:
            continuous.close()
            flight.close()


def _metrics(
    tap: Tap, flight: FlightRecorder, port: int | None, stack: ExitStack
) -> Callable[[], bytes] | None:
    """Count metrics, and serve them at ``port`` until ``stack`` is closed.

    None: prometheus_client is not there, and not needed.
    """
    try:
        from prometheus_client import generate_latest

        from robotd_metrics.metrics import registry, serve_metrics
    except ImportError as error:
        if port is None:
            return None
        text = "--metrics needs prometheus_client: pip install 'robotd[metrics]'"
        raise OperationError(text) from error
    made = registry(tap, flight)
    if port is not None:
        served = stack.enter_context(serve_metrics(made, port))
        log.info("metrics", url=f"http://127.0.0.1:{served}/metrics")
    return partial(generate_latest, made)
