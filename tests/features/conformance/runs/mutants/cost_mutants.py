"""Mutants: Cost and concurrency of the calls."""

from __future__ import annotations

import threading
import time

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import (
    ConnectionState,
    FloatArray,
    ProcessImage,
)
from robotd_sim import SimAxes, SimDevice

SWEEP_NS = 1_000_000_000

_STATE_LOCK = threading.Lock()


class BlockingRead(Mutant):
    breaks = ("drivers/loop", "blocks")
    found_by = "test_cost.py::test_read_does_not_block"
    says = "read takes"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            time.sleep(0.001)


class NowAndThenBlockingRead(Mutant):
    breaks = ("drivers/loop", "blocks")
    found_by = "test_cost.py::test_read_does_not_block"
    says = "99 of 100"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = self.__dict__.get("count", 0) + 1
            if count % 20 == 0:
                time.sleep(0.004)


class NewArrays(Mutant):
    breaks = ("AxisDriver.read/in-place", "side effect")
    found_by = "test_cost.py::test_read_fills_the_arrays_that_it_is_given"
    says = "arrays"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position = image.position.copy()


class OneCallerAtATime(Mutant):
    breaks = ("drivers/threads", "blocks")
    found_by = "test_threads.py::test_switching_servos_does_not_disturb_the_cycle"
    says = "called by two threads"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if self.__dict__.get("busy"):
                raise RuntimeError("called by two threads")
            self.__dict__["busy"] = True
            super().servo(axis, on, timeout_s)
            self.__dict__["busy"] = False


class LocksTheCycleOut(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = "test_threads.py::test_switching_servos_does_not_disturb_the_cycle"
    says = "held up the cycle|not ready"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            with self._world.lock:
                time.sleep(0.05)


class ReadsLeaveMemory(Mutant):
    breaks = ("drivers/loop", "leaks")
    found_by = "test_process.py::test_reading_needs_no_memory"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            self.__dict__.setdefault("log", []).append(bytearray(500))


class SeldomSlowReads(Mutant):
    breaks = ("drivers/loop", "blocks")
    found_by = "test_cost.py::test_no_read_of_many_is_slow_or_fails"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 101 == 0:
                time.sleep(0.006)


class SeldomFailingReads(Mutant):
    breaks = ("drivers/loop", "raises")
    found_by = "test_cost.py::test_no_read_of_many_is_slow_or_fails"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 701 == 0:
                raise ValueError("checksum")


class StateWaitsForServos(Mutant):
    breaks = ("DeviceDriver.state/blocks", "blocks")
    found_by = "test_cost.py::test_state_answers_while_something_slow_runs"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            with _STATE_LOCK:
                return super().state()

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            with _STATE_LOCK:
                time.sleep(0.1)


class SlowClose(Mutant):
    breaks = ("DeviceDriver.close/disconnects", "blocks")
    found_by = "test_process.py::test_closing_takes_no_time"

    class Device(SimDevice):
        def close(self) -> None:
            clock = self.simulation.clock
            clock.sleep_until_ns(clock.now_ns() + 4 * SWEEP_NS)
            super().close()


class ReadsLeaveALittleMemory(Mutant):
    breaks = ("drivers/loop", "leaks")
    found_by = "test_process.py::test_reading_needs_no_memory"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            self.__dict__.setdefault("log", []).append(float(image.fresh_ns))


class SlowStreams(Mutant):
    breaks = ("AxisDriver.stream/setpoint", "blocks")
    found_by = "test_cost.py::test_stream_does_not_block"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position, velocity, due_ns)
            time.sleep(0.001)


class VerySeldomFailingReads(Mutant):
    breaks = ("drivers/loop", "raises")
    found_by = "test_cost.py::test_no_read_of_many_is_slow_or_fails"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 1500 == 0:
                raise ValueError("checksum")


class SlowState(Mutant):
    breaks = ("DeviceDriver.state/blocks", "blocks")
    found_by = "test_cost.py::test_state_does_not_block"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            time.sleep(0.003)
            return super().state()


class ReadsSlowWhileMoving(Mutant):
    breaks = ("drivers/loop", "blocks")
    found_by = "test_cost.py::test_read_does_not_block_while_axes_move"

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            if image.operation.any():
                time.sleep(0.001)


class ReadWaitsForServos(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = "test_threads.py::test_switching_servos_does_not_disturb_the_cycle"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            with self._world.lock:
                time.sleep(0.04)
