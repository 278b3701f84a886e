"""Backends with one fault each, of the classes that the first mutants left out.

Motion and stops, alarms, neighbours, measured values, I/O, fieldbus, cost and the process.
"""

from __future__ import annotations

import locale
import os
import signal
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from tests.conformance.mutants import Mutant

from robotd.api import (
    BusStatus,
    CommandMode,
    ConnectionState,
    FloatArray,
    Operation,
    ProcessImage,
    Profile,
)
from robotd_sim import SimAxes, SimDevice, SimFaultInjector, SimFieldbus, SimIo

SWEEP_NS = 1_000_000_000


# Stops and ramps


class StopIgnoredInStreams(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop([a for a in axes if self._states.operation[a] != Operation.STREAM])


class QuickStopIgnoredInStreams(Mutant):
    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop([a for a in axes if self._states.operation[a] != Operation.STREAM])


class KeepsPushing(Mutant):
    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            servo = self._simulation.servo
            away = np.abs(servo.command - servo.position) > 0.03
            command = np.where(away, servo.command, position)
            super().stream(command, np.where(away, 0.0, velocity), due_ns)


class StopWaits(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            self._wait(lambda: not any(self._world.moves(axis) for axis in axes), 5.0)


class QuickStopWaits(Mutant):
    class Axes(SimAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            super().quick_stop(axes)
            clock = self._simulation.clock
            clock.sleep_until_ns(clock.now_ns() + 30_000_000)


class StopByAcceleration(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self._motion._deceleration[axis] = profile.acceleration


class StopByFixedRamp(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self._motion._deceleration[axis] = 4.0


class StopByFixedRampOfJog(Mutant):
    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            self._motion._deceleration[axis] = 4.0


class StopTooHard(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            self.quick_stop(axes)


class StopOnlyTheFirst(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(list(axes)[:1])


class StopAndReturn(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    if self._states.operation[axis] == Operation.POSITION:
                        here = float(self._simulation.servo.command[axis])
                        back = partial(self._motion.move, axis, here, Profile(0.5, 4.0, 4.0))
                        self._motion.brake(axis, 4.0, back)


class StopAndGoOn(Mutant):
    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            for axis in axes:
                target = float(self._simulation.servo.command[axis]) + 0.1
                later = partial(self._motion.move, axis, target, Profile(0.3, 4.0, 4.0))
                self._world.at(self._world.tick + 800, later)


class SwappedRamps(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            swapped = Profile(profile.velocity, profile.deceleration, profile.acceleration)
            super().move(axis, target, swapped)


class SwappedRampsOfJog(Mutant):
    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            swapped = Profile(profile.velocity, profile.deceleration, profile.acceleration)
            super().jog(axis, swapped)


class FixedAcceleration(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, Profile(profile.velocity, 4.0, profile.deceleration))


class FixedDeceleration(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, Profile(profile.velocity, profile.acceleration, 4.0))


class FixedVelocity(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, Profile(0.8, profile.acceleration, profile.deceleration))


class GentleRamps(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            ramps = 0.4 * profile.acceleration, 0.4 * profile.deceleration
            super().move(axis, target, Profile(profile.velocity, *ramps))


class Overshoots(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            start = float(self._simulation.servo.command[axis])
            super().move(axis, target + 0.03 * (target - start), profile)
            back = partial(self._motion.move, axis, target, Profile(0.3, 4.0, 4.0))
            self._world.at(self._world.tick + 1200, back)


class ShortMovesIgnored(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if abs(target - float(self._simulation.servo.command[axis])) > 0.02:
                super().move(axis, target, profile)


class WrapsTargets(Mutant):
    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, (target + np.pi) % (2 * np.pi) - np.pi, profile)


class WrapsPositions(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = (image.position + np.pi) % (2 * np.pi) - np.pi


class SmallGain(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = 1.003 * np.asarray(
                self._simulation.scaling.quantised(self._simulation.servo.position.tolist())
            )


class Drifts(Mutant):
    """1 mrad/s while an axis stands with its servo on."""

    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in np.flatnonzero(self._states.servo_on):
                    if self._motion.is_idle(int(axis)):
                        servo = self._simulation.servo
                        here = float(servo.command[axis]) + 2e-6
                        servo.place(int(axis), here, here, 0.0)
            super().read(image)
            image.position[:] = self._simulation.servo.position


class NoWatchdog(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            self._motion.stream._called = self._world.tick
            super().read(image)


# Alarms


class AlarmEndsAfterAWhile(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            seen = self.__dict__.setdefault("seen", set())
            for axis in set(np.flatnonzero(image.amp_alarm).tolist()) - seen:
                seen.add(axis)
                clear = partial(self._simulation.power.clear, axis)
                self._world.at(self._world.tick + 3000, clear)


class ClearsAllAlarms(Mutant):
    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            for each in range(self._simulation.axes):
                super().clear_alarm(each, timeout_s)


class ShortCodes(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.alarm_code[:] = self._states.alarm_code & 0xFF


class SignedCodes(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.alarm_code[:] = np.asarray(self._states.alarm_code).astype(np.int16)


class EmptyReason(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.reason[:] = ["alarm" if alarm else "" for alarm in image.amp_alarm]


class ServoOnClearsAlarms(Mutant):
    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if on and self._states.amp_alarm[axis]:
                self.clear_alarm(axis, timeout_s)
            super().servo(axis, on, timeout_s)


# Neighbours


class ModeOfAll(Mutant):
    class Axes(SimAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            for each in range(self._simulation.axes):
                super().set_command_mode(each, mode)


class PolarityOfAll(Mutant):
    class Axes(SimAxes):
        def set_polarity(self, axis: int, polarity: int) -> None:
            for each in range(self._simulation.axes):
                super().set_polarity(each, polarity)


class GearOfAll(Mutant):
    class Axes(SimAxes):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            for each in range(self._simulation.axes):
                super().set_gear_ratio(each, numerator, denominator)


class HomeOfAll(Mutant):
    class Axes(SimAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            for each in range(self._simulation.axes):
                super().home(each, timeout_s)


class HomeDoneFromTheStart(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_done[:] = True


# Measured values


class StampsGoBack(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 40 == 0:
                image.fresh_ns -= 5_000_000


class MeasuresItsCommand(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position[:] = image.position_command


class MeasuresItsCommandedVelocity(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity[:] = image.velocity_command


class CommandsItsMeasurement(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.position_command[:] = image.position


class TorqueBackwards(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[:] = -np.asarray(self._simulation.servo.measure()[1])


class TorqueZero(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.torque[:] = 0.0


class InjectorEchoes(Mutant):
    class Injector(SimFaultInjector):
        def position(self, axis: int) -> float:
            return float(self._simulation.servo.command[axis])


# I/O and fieldbus


class OutputsInMemoryOnly(Mutant):
    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            shadow = self.__dict__.setdefault("shadow", bytearray(self.output_bytes))
            return bytes(shadow[byte : byte + length])

        def write_outputs(self, byte: int, data: bytes) -> None:
            self._require_open()
            shadow = self.__dict__.setdefault("shadow", bytearray(self.output_bytes))
            shadow[byte : byte + len(data)] = data

        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            others = self.read_outputs(byte, 1)[0] & ~(1 << bit)
            self.write_outputs(byte, bytes([others | int(value) << bit]))


class OutputsAreInputs(Mutant):
    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            return self.read_outputs(byte, length)


class WritesWhileClosed(Mutant):
    class Io(SimIo):
        def _require_open(self) -> None:
            pass


class CountersAlwaysZero(Mutant):
    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            status.__dict__["lost_frames"] = 0
            return status


class CountersNeverReset(Mutant):
    class Fieldbus(SimFieldbus):
        def reset_statistics(self, bus: int) -> None:
            pass


class AxesMiscounted(Mutant):
    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            status = super().status(bus)
            status.__dict__["axes"] = 8
            return status


class AlwaysOperational(Mutant):
    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            from robotd.api import BusState

            status = super().status(bus)
            status.__dict__["state"] = BusState.OPERATIONAL
            return status


class WrongNodeIsLost(Mutant):
    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            from dataclasses import replace

            status = super().status(bus)
            if any(node.offline for node in status.nodes):
                nodes = tuple(replace(node, offline=node.id == 0) for node in status.nodes)
                status.__dict__["nodes"] = nodes
            return status


class RegistersConstant(Mutant):
    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return bytes(length)


class RegistersOfNodeZero(Mutant):
    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return super().read_register(bus, 0, address, length)


# Parameters


class ParametersIgnored(Mutant):
    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            from robotd.api import read_wmx_parameters

            read_wmx_parameters(path)
            return ""


class DumpOfAxisZero(Mutant):
    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            return super().dump_parameters(0)


# Cost and process


class ReadsLeaveMemory(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            self.__dict__.setdefault("log", []).append(bytearray(500))


class SeldomSlowReads(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 301 == 0:
                time.sleep(0.006)


class SeldomFailingReads(Mutant):
    class Axes(SimAxes):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 701 == 0:
                raise ValueError("checksum")


_STATE_LOCK = threading.Lock()


class StateWaitsForServos(Mutant):
    class Device(SimDevice):
        def state(self) -> ConnectionState:
            with _STATE_LOCK:
                return super().state()

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with _STATE_LOCK:
                super().servo(axis, on, timeout_s)
                time.sleep(0.1)


class SlowClose(Mutant):
    class Device(SimDevice):
        def close(self) -> None:
            clock = self.simulation.clock
            clock.sleep_until_ns(clock.now_ns() + 4 * SWEEP_NS)
            super().close()


class TakesSignals(Mutant):
    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGUSR1, signal.SIG_IGN)

    class Axes(SimAxes):
        def __init__(self, simulation: object) -> None:
            super().__init__(simulation)  # type: ignore[arg-type]
            os.umask(0o027)


class ChangesTheFolder(Mutant):
    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.chdir("/")


class ChangesTheLocale(Mutant):
    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            locale.setlocale(locale.LC_ALL, "C.UTF-8")
            locale.setlocale(locale.LC_NUMERIC, "POSIX")


class Prints(Mutant):
    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.write(1, b"vendor library 4.2 ready\n")


class ChangesTheEnvironment(Mutant):
    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            os.environ["OMP_NUM_THREADS"] = "1"
