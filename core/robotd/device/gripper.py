"""A gripper on one output bit, and its sensors of a part and of fingers."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import NANOSECONDS, Clock, wait_until
from robotd.descriptor import GripperSettings
from robotd.device.io import Io
from robotd.device.passive_joints import DrivenFingers, FingerReader
from robotd.device.process_image import ProcessImage
from robotd.device.stop_latch import StopLatch
from robotd.errors import InvalidArgument, NotReady, Unsupported
from robotd.events import logged_command

REACHED_SHARE = 0.05  # share of the stroke within which a position counts as reached
SETTLING_TIME_S = 0.05  # from the end of the travel to the sensor's answer
START_TIMEOUT_S = 0.3  # from a command to the first motion of measured fingers
TRAVEL_MARGIN_S = 2.0  # granted to measured fingers beyond their travel time
STOP_RETRY_S = 0.2  # until driven fingers that were stopped are at rest
HOMING_TIMEOUT_S = 30.0
DRIVEN_MARGIN_S = 10.0  # the same for driven ones, whose driver knows when they rest
STANDSTILL_SHARE = 1e-3  # share of the stroke that fingers at rest move in SETTLING_TIME_S


@dataclass(frozen=True)
class GripperState:
    """State of the fingers at the end of a move.

    Attributes:
        position_m: of the gripper, as far as it is known; rad for fingers that turn.
        reached: they are at the commanded position.
        stalled: they were stopped by a part before the commanded position.
        at_rest: they have stopped; False: the move was canceled or replaced on the way.
    """

    position_m: float
    reached: bool
    stalled: bool
    at_rest: bool


class Gripper:
    """Opens and closes by an output bit; its position follows from that, or is measured.

    Without a sensor of position, the position is what the command leads to, not what was felt: the
    fingers travel at constant speed from one end to the other, advanced by the control loop. An
    input may show that a part is held.

    Fingers with a driver stop on their way, and accept no command, while motion is stopped; an
    output bit switches a valve, which has no such stop.

    Args:
        stop_latch: of the robot's motion.
        measured: reads the positions of the fingers; None: they are not measured.
        driver: moves them to any position; None: the output bit does, to the two ends.

    Attributes:
        joints: names of the fingers.
        multipliers: position of each finger per position of the gripper; shape (fingers,).
        closed: part of the stroke that the fingers are closed by, 0 to 1.
        open_m, closed_m: position of the gripper at the two ends, rad for fingers that turn; set
            by ``configure``.
    """

    def __init__(
        self,
        io: Io,
        settings: GripperSettings,
        clock: Clock,
        stop_latch: StopLatch,
        measured: FingerReader | None = None,
        driver: DrivenFingers | None = None,
    ) -> None:
        self.joints = tuple(settings.joints)
        self.multipliers: FloatArray = np.array(settings.multipliers or [1.0] * len(self.joints))
        self.open_m, self.closed_m = settings.open_m, settings.closed_m
        self._io, self._settings, self._clock = io, settings, clock
        self._stop_latch, self._stop_due_ns = stop_latch, 0
        self._byte = settings.output_byte
        self._bit = settings.output_bit
        self._commanded = io.output_watcher(self._byte, self._bit)
        self._has_sensor = settings.part_sensor is not None
        sensor = settings.part_sensor
        self._holds_part = (
            io.input_watcher(sensor.input_byte, sensor.input_bit) if sensor else lambda: False
        )
        self._travel_ns = settings.travel_time_s * NANOSECONDS
        self.closed = 0.0  # 0 to 1
        self._last_ns = 0
        self._moves = 0  # counts them: the newest one replaces the others
        self._lock = threading.Lock()
        self._measured, self._driver = measured, driver
        self.events = io.events
        self.is_measured = measured is not None
        self._fingers: FloatArray = self.multipliers * self.open_m
        self._moving = np.flatnonzero(self.multipliers)
        self._shares = 1.0 / (self.multipliers[self._moving] * len(self._moving))
        # Where the fingers were last in motion, and when; and when they were measured last.
        self._still_m, self._still_ns, self._seen_ns = math.inf, 0, 0

    def configure(self, open_m: float, closed_m: float) -> None:
        """Set the positions of the two ends, which differ. Before the start only."""
        self.open_m, self.closed_m = open_m, closed_m

    def command(self, closed: bool) -> int:
        """Close (True) or open the gripper; any worker.

        Returns the number of the move that this begins. Raises NotReady without the engine, and
        for driven fingers while motion is stopped.
        """
        if self._driver is not None:
            self._stop_latch.check()
        with self._lock:
            self._moves += 1
            self._io.set_output_bit(self._byte, self._bit, closed)
            return self._moves

    @logged_command
    def drive(self, position_m: float, force_n: float) -> int:
        """Begin to move driven fingers to a position; any worker.

        Returns the number of the move that this begins. Raises NotReady, also while motion is
        stopped; InvalidArgument without a driver.
        """
        if self._driver is None:
            raise InvalidArgument("the fingers are not driven: the output opens or closes them")
        self._stop_latch.check()
        with self._lock:
            self._moves += 1
            self._io.output_bit(self._byte, self._bit)  # raises NotReady
            positions = dict(
                zip(self.joints, (self.multipliers * position_m).tolist(), strict=True)
            )
            self._driver.move(positions, force_n)
            return self._moves

    @logged_command
    def home(self) -> None:
        """Let driven fingers find the ends of their stroke, which moves them; wait for it.

        Any worker. A stop of all motion, and a later command, end it. Raises NotReady, also while
        motion is stopped; OperationError: the ends were not found, or it was ended. DeviceTimeout.
        Unsupported: nothing can be homed here.
        """
        if self._driver is None:
            raise Unsupported("homing of the gripper", self._io.backend)
        self._stop_latch.check()
        with self._lock:
            self._moves += 1
            self._io.output_bit(self._byte, self._bit)  # raises NotReady
        self._driver.home(HOMING_TIMEOUT_S)

    def checked(self, position_m: float) -> float:
        """Return a commanded position of the gripper.

        Raises InvalidArgument where it is not between open and closed, with the margin of
        ``REACHED_SHARE``.
        """
        low, high = sorted((self.open_m, self.closed_m))
        margin = REACHED_SHARE * (high - low)
        if not (math.isfinite(position_m) and low - margin <= position_m <= high + margin):
            raise InvalidArgument(f"gripper: position {position_m} m is outside {low} to {high} m")
        return position_m

    def checked_force(self, force_n: float) -> float:
        """Return a limit of force, N; 0: the device's own, also where fingers are not driven.

        Raises InvalidArgument.
        """
        if self._driver is None:
            return 0.0
        if not (math.isfinite(force_n) and force_n >= 0.0):
            raise InvalidArgument(f"gripper: force of {force_n:g} N, must be 0 or more")
        return force_n

    def checked_fingers(self, positions: Mapping[str, float]) -> float:
        """Return the position of the gripper that leads to the ``positions`` of fingers, by name.

        Raises InvalidArgument for an unknown finger, or positions that the fingers cannot have at
        the same time, with the margin of ``REACHED_SHARE``.
        """
        if unknown := [name for name in positions if name not in self.joints]:
            known = ", ".join(self.joints)
            raise InvalidArgument(f"joint {unknown[0]} is unknown (available: {known})")
        wanted = {
            name: position / factor
            for name, factor in zip(self.joints, self.multipliers.tolist(), strict=True)
            if factor and (position := positions.get(name)) is not None
        }
        if not wanted:
            raise InvalidArgument("the command has no position of a finger that moves")
        if max(wanted.values()) - min(wanted.values()) > REACHED_SHARE * abs(
            self.closed_m - self.open_m
        ):
            named = ", ".join(f"{name} {positions[name]:g}" for name in wanted)
            factors = ", ".join(f"{factor:g}" for factor in self.multipliers)
            raise InvalidArgument(
                f"the fingers move together, by the multipliers {factors}: they cannot be at"
                f" {named} at the same time"
            )
        return self.checked(next(iter(wanted.values())))

    def move(
        self, position_m: float, is_canceled: Callable[[], bool], force_n: float = 0.0
    ) -> GripperState:
        """Open or close, whichever end is nearer, and wait until the fingers are at rest.

        Any worker. A later command replaces it. Canceling leaves the output as it is: a valve has
        no position between its ends. Driven fingers go to any position, and canceling stops them.
        Raises NotReady without the engine, also where it is lost meanwhile: where the fingers are
        is not known; for driven fingers also by a stop of all motion.

        Args:
            position_m: of the gripper, from ``checked`` or ``checked_fingers``.
            is_canceled: ends the wait.
            force_n: that driven fingers may press a part with, N; 0: the device's own.
        """
        state = self._move(position_m, is_canceled, force_n)
        self._io.output_bit(self._byte, self._bit)  # raises NotReady
        return state

    def _move(
        self, position_m: float, is_canceled: Callable[[], bool], force_n: float
    ) -> GripperState:
        if self._driver is not None:
            return self._move_driven(self._driver, position_m, is_canceled, force_n)
        closes = abs(position_m - self.closed_m) < abs(position_m - self.open_m)
        move, end = self.command(closes), float(closes)

        def interrupted() -> bool:
            return is_canceled() or self._moves != move

        held = closes and self._has_sensor
        travel_s = self._settings.travel_time_s + (SETTLING_TIME_S if held else 0.0)
        if self.is_measured:
            return self._wait_measured(position_m, travel_s, interrupted)
        wait_until(lambda: interrupted() or (held and self._holds_part()), travel_s, self._clock)
        if held and self._holds_part():
            return GripperState(self.position_m, False, True, True)
        if interrupted() and self.closed != end:
            return GripperState(self.position_m, False, False, False)
        end_m = self.closed_m if closes else self.open_m
        near = abs(end_m - position_m) <= REACHED_SHARE * abs(self.closed_m - self.open_m)
        return GripperState(end_m, near, not near, True)

    def _move_driven(
        self,
        driver: DrivenFingers,
        position_m: float,
        is_canceled: Callable[[], bool],
        force_n: float,
    ) -> GripperState:
        low, high = sorted((self.open_m, self.closed_m))
        target_m = min(max(position_m, low), high)
        stops = self._stop_latch.stops
        move = self.drive(target_m, force_n)
        limit_s = self._settings.travel_time_s + DRIVEN_MARGIN_S

        def is_over() -> bool:
            stopped = self._stop_latch.stops != stops
            return stopped or is_canceled() or self._moves != move or driver.at_rest

        wait_until(is_over, limit_s, self._clock)
        if self._stop_latch.stops != stops:
            raise NotReady(f"the fingers were stopped: {self._stop_latch.reason or 'by a stop'}")
        with self._lock:
            if self._moves != move or not driver.at_rest:
                if is_canceled() and self._moves == move:
                    driver.stop()
                return GripperState(self.position_m, False, False, False)
        return self._rest(position_m)

    def _wait_measured(
        self, position_m: float, travel_s: float, interrupted: Callable[[], bool]
    ) -> GripperState:
        """Wait until the fingers have moved, or should have, and rest. Any worker."""
        start_m, began_ns = self.position_m, self._clock.now_ns()
        stroke_m = abs(self.closed_m - self.open_m)

        def at_rest() -> bool:
            now_ns = self._clock.now_ns()
            has_begun = (
                abs(self.position_m - start_m) > REACHED_SHARE * stroke_m
                or now_ns - began_ns > START_TIMEOUT_S * NANOSECONDS
            )
            settle_ns = SETTLING_TIME_S * NANOSECONDS
            return has_begun and now_ns - self._still_ns > settle_ns > now_ns - self._seen_ns

        limit_s = max(travel_s, START_TIMEOUT_S) + TRAVEL_MARGIN_S
        stopped = wait_until(lambda: interrupted() or at_rest(), limit_s, self._clock)
        if not stopped or (interrupted() and not at_rest()):
            return GripperState(self.position_m, False, False, False)
        return self._rest(position_m)

    def _rest(self, position_m: float) -> GripperState:
        """Return the state of measured fingers that rest after a move to ``position_m``."""
        reached_m, found_m = REACHED_SHARE * abs(self.closed_m - self.open_m), self.position_m
        reached = abs(found_m - position_m) <= reached_m
        return GripperState(found_m, reached, not reached, True)

    @property
    def is_commanded_closed(self) -> bool:
        """Commanded state of the output bit. Any thread."""
        return self._commanded()

    @property
    def position_m(self) -> float:
        """Position of the gripper: the mean of the fingers where they are measured. Any thread."""
        return self.open_m + (self.closed_m - self.open_m) * self.closed

    @property
    def finger_ends(self) -> dict[str, tuple[float, float]]:
        """Position of each finger when open and when closed, rad or m. Any thread."""
        factors = self.multipliers.tolist()
        return {
            name: (self.open_m * factor, self.closed_m * factor)
            for name, factor in zip(self.joints, factors, strict=True)
        }

    @property
    def finger_positions(self) -> FloatArray:
        """Positions of the fingers (fingers,), rad or m; a copy. Any thread."""
        return self._fingers.copy() if self.is_measured else self.multipliers * self.position_m

    def advance(self, image: ProcessImage) -> None:
        """Measure the fingers, or let them travel until a part stops them. Control-loop thread.

        Once a period.
        """
        if self._driver is not None and self._stop_latch.reason:
            self._stop_driven(self._driver, image.stamp_ns)
        if self._measured is not None:
            self._measured(self._fingers)
            self._read_fingers(image.stamp_ns)
            return
        closes = self._commanded()
        elapsed_ns, self._last_ns = image.stamp_ns - self._last_ns, image.stamp_ns
        if closes and self._holds_part():
            return
        step = elapsed_ns / self._travel_ns if self._travel_ns else 1.0
        self.closed += min(max(float(closes) - self.closed, -step), step)

    def _stop_driven(self, driver: DrivenFingers, now_ns: int) -> None:
        """Stop the fingers until they are at rest. At rest they may hold a part: no stop then."""
        if now_ns >= self._stop_due_ns and not driver.at_rest:
            driver.stop()
            self._stop_due_ns = now_ns + round(STOP_RETRY_S * NANOSECONDS)

    def _read_fingers(self, now_ns: int) -> None:
        """Derive the position of the gripper from its fingers, and note when they moved last."""
        position_m = float(self._fingers[self._moving] @ self._shares)
        if not math.isfinite(position_m):
            return
        self._seen_ns = now_ns
        self.closed = (position_m - self.open_m) / (self.closed_m - self.open_m)
        if not abs(position_m - self._still_m) <= STANDSTILL_SHARE * abs(
            self.closed_m - self.open_m
        ):
            self._still_m, self._still_ns = position_m, now_ns
