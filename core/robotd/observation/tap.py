"""Tap of a robot: the one mechanism that page, recorder and metrics observe it by.

``frames`` has every period of the control loop and ``events`` all that happened, both bounded;
a reader keeps a cursor in each and takes what is new, in its own thread and at its own rate.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Self

from robotd import log as robot_log
from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.clock.simulated import bounded
from robotd.descriptor.urdf import read_urdf_text
from robotd.device.bus_status import BusState, BusStatus
from robotd.device.state import ConnectionState
from robotd.device.world import POSE_VALUES
from robotd.entry_points import module_of, owner_of
from robotd.errors import DescriptorError, RobotdError
from robotd.events import MAX_BYTES, BoundedLog, EventKind, EventLog, Level
from robotd.log import get_logger
from robotd.observation.change_detector import ChangeDetector
from robotd.observation.frame_ring import MEMORY_BYTES, FrameRing
from robotd.observation.io_sampler import (
    FIELDBUS,
    OBJECTS,
    QUEUE_BYTES,
    IoSampler,
    NamedValues,
    Sample,
)
from robotd.observation.period_writer import period_writer
from robotd.robot import Robot

log = get_logger("tap")

SAMPLE_PERIOD_S = 0.1
MIN_OBSERVATIONS = 4  # of the frames that are held, in simulated time
MAX_AHEAD_S = 2.0  # of simulated time, between a fault and its observation
BUS_PERIOD_SAMPLES = 10
MAX_SAMPLES = 16384
SAMPLE_BYTES = 2 * 2**20 - QUEUE_BYTES
SAMPLE_OVERHEAD_BYTES = 200
VALUE_BYTES = 100  # of a value of the fieldbus with its name
# 22 MiB; tests assert it.
MAX_MEMORY_BYTES = MEMORY_BYTES + MAX_BYTES + SAMPLE_BYTES + QUEUE_BYTES
_BUS_STATES = {state: number for number, state in enumerate(BusState)}


class Tap:
    """Observes a robot from inside its process: ``with Tap(robot, seconds) as tap:``.

    The control loop copies its values once a period. The thread ``robotd-tap`` does the rest:
    it finds faults and changes of state in the frames, samples I/O and fieldbus, and calls
    the readers.

    Args:
        robot: not started.
        seconds: time for which the frames are held.

    Attributes:
        frames: last frames of the control loop.
        events: the robot's event log.
        samples: I/O where it changes, in every period on a backend with a live image, else at
            10 Hz, the fieldbus once a second, and objects of a simulated world at 10 Hz.
        fieldbus: newest state and counters of each bus and node; empty without one.
        buses: newest status of each bus; without those that could not be read.
        urdf: text of the robot's URDF; "" without one.
    """

    def __init__(self, robot: Robot, seconds: float) -> None:
        self.robot = robot
        self.events: EventLog = robot.events
        rate_hz = robot.descriptor.cycle.rate_hz
        self.frames = FrameRing(robot.image.axes, rate_hz, seconds)
        self.samples: BoundedLog[Sample] = BoundedLog(MAX_SAMPLES, SAMPLE_BYTES)
        self.fieldbus: NamedValues = {}
        self.buses: dict[int, BusStatus] = {}
        self._offset_ns = time.time_ns() - robot.clock.now_ns()
        self.urdf = _text(robot.descriptor.urdf)
        self._detector = ChangeDetector(self.frames.reasons, robot.axes.names)
        self._cursor = 0
        self._observed = 0
        self._io = IoSampler(robot.io, robot.clock.now_ns)
        self._readers: list[Callable[[], None]] = []
        self._failing: set[Callable[[], None]] = set()  # steps whose last call raised
        self._was_stopped = False
        self._stop, self._wake = threading.Event(), threading.Event()
        self._bound = ExitStack()  # of simulated time
        self._advance: Callable[[], None] = lambda: None
        self._thread = threading.Thread(target=self._run, name="robotd-tap", daemon=True)
        robot.control_loop.observe(period_writer(robot, self.frames, self._io))

    def add_reader(self, read: Callable[[], None]) -> None:
        """Call ``read`` after every sample, in the tap's thread; before ``start`` only."""
        self._readers.append(read)

    @property
    def offset_ns(self) -> int:
        """Wall-clock time minus monotonic time of the robot's clock; simulated: at the start."""
        clock = self.robot.clock
        if isinstance(clock, MonotonicClock):  # that of the wall may be set at any time
            return time.time_ns() - clock.now_ns()
        return self._offset_ns

    @property
    def nbytes(self) -> int:
        """Memory in use; at most ``MAX_MEMORY_BYTES``."""
        held = (self.frames, self.events, self.samples)
        return sum(array.nbytes for array in held) + QUEUE_BYTES

    def __enter__(self) -> Self:
        robot_log.add_listener(self._log_line)
        self.robot.axes.stop_latch.on_change(self._stop_line)
        held_s = self.frames.capacity / self.robot.descriptor.cycle.rate_hz
        ahead_ns = round(min(held_s / MIN_OBSERVATIONS, MAX_AHEAD_S) * NANOSECONDS)
        # Without a bound the frames of a fast simulation are overwritten before they are read.
        bound = bounded(self.robot.clock, ahead_ns, self._wake)
        self._advance = self._bound.enter_context(bound)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._wake.set()
        self._thread.join()
        robot_log.remove_listener(self._log_line)
        self.observe()
        self._bound.close()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._wake.wait(SAMPLE_PERIOD_S)
            self._wake.clear()
            if not self._stop.is_set():
                self.observe()
                self._advance()

    def observe(self) -> None:
        """Look for changes, take samples, call the readers.

        What fails holds up nothing else, and is logged once until it succeeds.
        """
        communicates = self.robot.connection.state is ConnectionState.COMMUNICATING
        samples = (self._sample_io, self._sample_objects, self._sample_fieldbus)
        for step in (self._find_changes, *(samples if communicates else ()), *self._readers):
            try:
                step()
                self._failing.discard(step)
            except Exception:
                if step not in self._failing:
                    name, plugin = getattr(step, "__qualname__", step), owner_of(module_of(step))
                    log.exception("the tap failed", plugin=plugin, step=name)
                self._failing.add(step)

    def _find_changes(self) -> None:
        frames, self._cursor, _ = self.frames.since(self._cursor)
        for event in self._detector.events(frames):
            self.events.note(event)

    def _sample_io(self) -> None:
        for sample in self._io.changes():
            self.samples.append(sample, SAMPLE_OVERHEAD_BYTES + len(sample[2]))

    def _sample_objects(self) -> None:
        if (world := self.robot.world) is not None and world.objects:
            poses = {
                item.name: dict(zip(POSE_VALUES, pose, strict=True))
                for item, pose in zip(world.objects, world.poses().tolist(), strict=True)
            }
            size = SAMPLE_OVERHEAD_BYTES + len(poses) * len(POSE_VALUES) * VALUE_BYTES
            self.samples.append((self.robot.clock.now_ns(), OBJECTS, poses), size)

    def _sample_fieldbus(self) -> None:
        if self._observed % BUS_PERIOD_SAMPLES == 0:
            now_ns = self.robot.clock.now_ns()
            self.buses = self._read_buses()
            self.fieldbus = {
                name: values
                for bus, status in self.buses.items()
                for name, values in bus_values(bus, status).items()
            }
            values = sum(map(len, self.fieldbus.values()))
            size = SAMPLE_OVERHEAD_BYTES + values * VALUE_BYTES
            self.samples.append((now_ns, FIELDBUS, self.fieldbus), size)
        self._observed += 1

    def _read_buses(self) -> dict[int, BusStatus]:
        buses: dict[int, BusStatus] = {}
        fieldbus = self.robot.fieldbus
        for bus in range(fieldbus.buses):
            with suppress(RobotdError):
                buses[bus] = fieldbus.status(bus)
        return buses

    def _stop_line(self, reason: str) -> None:
        """Note a stop of all motion, or its end. Any thread, the control loop too."""
        if reason:
            text, outcome = f"all motion stopped: {reason}", "stopped"
        elif self._was_stopped:
            text, outcome = "motion is allowed again", "reset"
        else:
            return
        self._was_stopped = bool(reason)
        level = Level.ERROR if reason else Level.INFO
        self.events.add(EventKind.STOP, "stop", text, level=level, data={"outcome": outcome})

    def _log_line(self, line: robot_log.LogLine) -> None:
        """Note a line of the log. Any thread, the control loop too."""
        level = Level(line.level) if line.level in tuple(Level) else Level.ERROR
        self.events.add(EventKind.LOG, line.component, line.text, level=level, data=line.fields)


def bus_values(bus: int, status: BusStatus) -> dict[str, Mapping[str, float]]:
    """Return the numbers of a fieldbus and its nodes: ``bus0``, ``bus0/node3``.

    ``state`` is the position in ``BusState``: 0 unknown, 4 operational.
    """
    values: dict[str, Mapping[str, float]] = {
        f"bus{bus}": {
            "state": _BUS_STATES[status.state],
            "lost_frames": status.lost_frames,
            "timeouts": status.timeouts,
            "late_cycles": status.late_cycles,
            **status.extra,
        }
    }
    for node in status.nodes:
        values[f"bus{bus}/node{node.id}"] = {
            "state": _BUS_STATES[node.state],
            "offline": node.offline,
            "error_code": node.error_code,
            **node.extra,
        }
    return values


def _text(path: Path | None) -> str:
    with suppress(DescriptorError):
        return read_urdf_text(path) if path else ""
    return ""
