"""Backends with one fault each, put into the drivers of the simulation.

A mutant is a plugin of its own: entry point ``tests.conformance.mutants:<name>``.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import ClassVar

import numpy as np

import robotd_sim
from robotd.api import (
    BackendInfo,
    Capability,
    ConnectionState,
    DeviceContext,
    DeviceDriver,
    DeviceTimeout,
    FaultInjector,
    FloatArray,
    ProcessImage,
    Profile,
    Underrun,
    Unsupported,
    hookimpl,
)
from robotd_sim import (
    SimAxes,
    SimDevice,
    SimFaultInjector,
    SimFieldbus,
    SimIo,
    SimOptions,
    Simulation,
)
from robotd_wmx_parameters import read_wmx_parameters

DEGREES = 180.0 / np.pi


class Mutant:
    """The simulation as a plugin whose drivers can be exchanged."""

    Device: ClassVar[type[SimDevice]] = SimDevice
    Axes: ClassVar[type[SimAxes]] = SimAxes
    Io: ClassVar[type[SimIo]] = SimIo
    Fieldbus: ClassVar[type[SimFieldbus]] = SimFieldbus
    Injector: ClassVar[type[SimFaultInjector]] = SimFaultInjector

    @hookimpl
    def robotd_backend(self) -> BackendInfo:
        return BackendInfo(
            summary="a mutant",
            api_version=1,
            capabilities=robotd_sim.CAPABILITIES,
            options=SimOptions,
        )

    @hookimpl
    def robotd_open_device(self, context: DeviceContext[SimOptions]) -> DeviceDriver:
        return self.Device(Simulation(context.robot, context.options, context.clock))

    @hookimpl
    def robotd_axes(self, device: SimDevice) -> SimAxes:
        return self.Axes(device.simulation)

    @hookimpl
    def robotd_io(self, device: SimDevice) -> SimIo:
        return self.Io(device.simulation)

    @hookimpl
    def robotd_fieldbus(self, device: SimDevice) -> SimFieldbus:
        return self.Fieldbus(device.simulation)

    @hookimpl
    def robotd_fault_injector(self, device: SimDevice) -> FaultInjector:
        return self.Injector(device.simulation)


# Units and signs


class SignFlipped(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, -target, profile)


class MirroredThroughout(Mutant):
    """Commands and measured values agree, but the shaft turns the other way."""

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for values in (
                image.position,
                image.velocity,
                image.position_command,
                image.velocity_command,
            ):
                np.negative(values, values)

        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, -target, profile)


class Degrees(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target * DEGREES, profile)


class StreamedDegrees(Mutant):
    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            super().stream(position / DEGREES, velocity / DEGREES, due_ns)


class SaysItStands(Mutant):
    class Axes(SimAxes):
        @property
        def underrun(self) -> Underrun:
            return Underrun.HOLD


class TurnsPerMinute(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity *= 60.0 / (2.0 * np.pi)


class AxesSwapped(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move({0: 1, 1: 0}.get(axis, axis), target, profile)


class JogsBackwards(Mutant):
    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            back = Profile(-profile.velocity, profile.acceleration, profile.deceleration)
            super().jog(axis, back)


# Profiles and stops


class TooFast(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            fast = Profile(1.5 * profile.velocity, profile.acceleration, profile.deceleration)
            super().move(axis, target, fast)


class TooSteep(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            steep = Profile(profile.velocity, 2 * profile.acceleration, 2 * profile.deceleration)
            super().move(axis, target, steep)


class JumpsToNewTargets(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            with self._world.lock:
                self._world.advance()
                here = float(self._simulation.servo.command[axis])
                self._simulation.servo.place(axis, here, here, 0.0)
            super().move(axis, target, profile)


class StopThatDoesNotStop(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            pass


class QuickStopThatCoasts(Mutant):
    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    self._motion.brake(axis, 1.0)


class StopsEverything(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(range(self._simulation.axes))


# Enabling and streaming


class JumpAtEnable(Mutant):
    """The position command of before the servo went off is in force again."""

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = bool(self._states.servo_on[axis])
            if was_on and not on:
                old = self.__dict__.setdefault("old", {})
                old[axis] = float(self._simulation.servo.command[axis])
            super().servo(axis, on, timeout_s)
            if on and not was_on and axis in self.__dict__.get("old", {}):
                self.move(axis, self.__dict__["old"][axis], Profile(3.0, 30.0, 30.0))


class ServoThatLies(Mutant):
    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with self._world.lock:
                self._world.advance()
                late = self._world.tick + 200
                power = self._simulation.power
                self._world.at(late, lambda: power.request(axis, on=on))


class EnablesByItself(Mutant):
    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                for axis in range(self.simulation.axes):
                    self.simulation.power.request(axis, on=True)


class SpringsBack(Mutant):
    """After a stream an axis goes back to where the stream began."""

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            self.__dict__["old"] = self._simulation.servo.command.copy()
            super().begin_stream(axes)

        def end_stream(self, axes: Sequence[int]) -> None:
            super().end_stream(axes)
            for axis in axes:
                self.move(axis, float(self.__dict__["old"][axis]), Profile(0.5, 5.0, 5.0))


# Values and faults


class StaleValues(Mutant):
    """New positions come three times a second."""

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            kept, since_ns = self.__dict__.get("kept", (None, 0))
            if kept is None or image.fresh_ns - since_ns > 300_000_000:
                self.__dict__["kept"] = (image.position.copy(), image.fresh_ns)
            else:
                image.position[:] = kept


class AlwaysFresh(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = self._simulation.clock.now_ns()


class AnotherClock(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.fresh_ns = time.monotonic_ns()


class SwallowedFault(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.amp_alarm[:] = False
            image.alarm_code[:] = 0


class HealsItself(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            clear = self._simulation.power.clear
            for axis in np.flatnonzero(image.amp_alarm):
                self._world.at(self._world.tick + 100, partial(clear, int(axis)))


class ReasonThatStays(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            told = self.__dict__.setdefault("told", list(image.reason))
            told[:] = [new or old for new, old in zip(image.reason, told, strict=True)]
            image.reason[:] = told


class FaultThatBlocks(Mutant):
    class Device(SimDevice):
        def fault(self) -> str:
            time.sleep(0.01)
            return super().fault()


class ClearingEnables(Mutant):
    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            super().clear_alarm(axis, timeout_s)
            self.servo(axis, True, timeout_s)


class StartsLater(Mutant):
    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            timed_out = timeout_s
            try:
                super().start_communication(timeout_s)
            except DeviceTimeout:
                timed_out = 0.0
                raise
            finally:
                self.late = timed_out == 0.0

        def stop_communication(self, timeout_s: float) -> None:
            if not self.late:
                super().stop_communication(timeout_s)


class RescalesLiveAxes(Mutant):
    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            parameters = read_wmx_parameters(path, self.simulation.axes)
            with self.simulation.world.lock:
                self.simulation.apply(parameters)
            return ""


class DefaultsForAbsentAxes(Mutant):
    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            parameters = read_wmx_parameters(path)
            with self.simulation.world.lock:
                self.simulation.load(parameters)
            return ""


class StateThatLies(Mutant):
    class Device(SimDevice):
        def state(self) -> ConnectionState:
            state = super().state()
            return ConnectionState.COMMUNICATING if state is ConnectionState.RUNNING else state


# Time, threads, handles


class BlockingRead(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            time.sleep(0.001)


class NowAndThenBlockingRead(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = self.__dict__.get("count", 0) + 1
            if count % 20 < 2:  # two in turn, as the checks read between the cycle's reads
                time.sleep(0.004)


class NewArrays(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position = image.position.copy()


class OneCallerAtATime(Mutant):
    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if self.__dict__.get("busy"):
                raise RuntimeError("called by two threads")
            self.__dict__["busy"] = True
            super().servo(axis, on, timeout_s)
            self.__dict__["busy"] = False


class LocksTheCycleOut(Mutant):
    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            with self._world.lock:
                time.sleep(0.05)


class LeakedThread(Mutant):
    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            ended = threading.Event()
            threading.Thread(target=ended.wait, args=(20.0,), name="forgotten", daemon=True).start()


class LeakedHandle(Mutant):
    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.open(os.devnull, os.O_RDONLY)


# I/O, fieldbus


class NeighboursClobbered(Mutant):
    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            self.write_outputs(byte, bytes([int(value) << bit]))


class BitsGetLost(Mutant):
    """Read, change, write, without a lock."""

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            others = self.read_outputs(byte, 1)[0] & ~(1 << bit)
            time.sleep(0.0005)
            self.write_outputs(byte, bytes([others | int(value) << bit]))


class Boaster(Mutant):
    """Declares registers and cannot read them."""

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            raise Unsupported(Capability.REGISTER_READ, "boaster")
