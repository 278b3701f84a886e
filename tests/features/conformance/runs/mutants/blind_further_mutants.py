"""Mutants: Further faults, written from the contract before any check was run on them."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import (
    BusStatus,
    ConnectError,
    FloatArray,
    NotReady,
    Operation,
    ProcessImage,
    Profile,
)
from robotd_sim import SimAxes, SimDevice, SimFieldbus, SimIo


class VelocityClipped(Mutant):
    breaks = ("AxisDriver.move/profile", "clipped")
    found_by = "test_small_and_large.py::test_each_move_has_its_own_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, replace(profile, velocity=min(profile.velocity, 0.65)))


class EarlyStopsIgnored(Mutant):
    """In the first 150 ms of a move."""

    breaks = ("AxisDriver.stop/starts", "ignored")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_move"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("began", {})[axis] = self._world.now_ns

        def stop(self, axes: Sequence[int]) -> None:
            began, now = self.__dict__.get("began", {}), self._world.now_ns
            super().stop([axis for axis in axes if now - began.get(axis, 0) > 150_000_000])


class StoppingForEver(Mutant):
    breaks = ("AxisDriver.read/states", "stale")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_jogs"

    class Axes(ReadAnew):
        def quick_stop(self, axes: Sequence[int]) -> None:
            moving = [a for a in axes if self._states.operation[a] != Operation.IDLE]
            self.__dict__.setdefault("stopped", set()).update(moving)
            super().quick_stop(axes)

        def move(self, axis: int, target: float, profile: Profile) -> None:
            self.__dict__.setdefault("stopped", set()).discard(axis)
            super().move(axis, target, profile)

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis in self.__dict__.get("stopped", ()):
                image.operation[axis] = Operation.STOPPING


class AcceleratingJogsAreNotStopped(Mutant):
    breaks = ("AxisDriver.stop/starts", "ignored")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_jogs"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            servo, chosen = self._simulation.servo, []
            for axis in axes:
                jogs = self._states.operation[axis] == Operation.VELOCITY
                if not (jogs and servo.command_velocity[axis] < 0.0):
                    chosen.append(axis)
            super().stop(chosen)


class ServoOffStopsOthers(Mutant):
    breaks = ("AxisDriver.servo/switches", "side effect")
    found_by = "test_enable.py::test_switching_a_servo_leaves_moving_axes_alone"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if not on:
                super().stop([other for other in range(self._simulation.axes) if other != axis])


class ClearingRaisesWithoutAlarm(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "side effect")
    found_by = "test_faults.py::test_clearing_without_an_alarm_has_no_effect"

    class Axes(SimAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            if not self._states.amp_alarm[axis]:
                raise NotReady("there is no alarm")
            super().clear_alarm(axis, timeout_s)


class BrakesGentlyBackwards(Mutant):
    breaks = ("AxisDriver.move/profile", "one direction")
    found_by = "test_ramps.py::test_a_move_has_the_ramps_of_its_profile"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            if target < float(self._simulation.servo.command[axis]):
                profile = replace(profile, deceleration=0.7 * profile.deceleration)
            super().move(axis, target, profile)


class OffsetAfterAStop(Mutant):
    breaks = ("AxisDriver.move/target", "wrong value")
    found_by = "test_stopping.py::test_a_stopped_axis_takes_the_next_move"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            moving = [a for a in axes if self._states.operation[a] != Operation.IDLE]
            self.__dict__.setdefault("off", set()).update(moving)
            super().stop(axes)

        def move(self, axis: int, target: float, profile: Profile) -> None:
            off = axis in self.__dict__.get("off", set())
            super().move(axis, target + 0.004 * off, profile)
            self.__dict__.setdefault("off", set()).discard(axis)


class LastJogReversed(Mutant):
    breaks = ("AxisDriver.jog/starts", "last axis")
    found_by = "test_units.py::test_a_positive_velocity_raises_the_position"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            last = axis == self._simulation.axes - 1
            velocity = -profile.velocity if last else profile.velocity
            super().jog(axis, replace(profile, velocity=velocity))


class SmallJogChangesIgnored(Mutant):
    breaks = ("AxisDriver.jog/changes", "ignored")
    found_by = "test_velocity_commands.py::test_a_velocity_command_is_changed_without_a_jump"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            speed = float(self._simulation.servo.command_velocity[axis])
            if profile.velocity * speed <= 0.0 or abs(speed) < 0.01:
                super().jog(axis, profile)


class VelocityStreamKicks(Mutant):
    breaks = ("AxisDriver.begin_stream/follows", "wrong value")
    found_by = "test_units.py::test_a_streamed_velocity_is_a_measured_velocity"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            with self._world.lock:
                stream = self._motion.stream
                for axis in axes:
                    if stream.by_velocity[axis]:
                        stream.velocity[axis] = 0.2
                        here = stream.position[axis]
                        self._simulation.servo.follow(axis, self._world.tick, here, 0.2, 0.0)


class EverySecondSetpointDropped(Mutant):
    breaks = ("AxisDriver.stream/setpoint", "ignored")
    found_by = "test_trajectories.py::test_a_canceled_trajectory_stops_within_the_limits"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 8 == 0:
                super().stream(position, velocity, due_ns)


class FirstAxisNotStreamed(Mutant):
    breaks = ("AxisDriver.stream/position", "last axis")
    found_by = "test_units.py::test_a_streamed_radian_is_a_measured_radian"

    class Axes(SimAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            if len(axes) > 1 and 0 in axes:
                with self._world.lock:
                    self._motion.end_stream(0)


class StreamsEndLate(Mutant):
    breaks = ("AxisDriver.end_stream/moves", "ignored")
    found_by = "test_streams.py::test_groups_of_axes_stream_by_themselves"

    class Axes(SimAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            with self._world.lock:
                self._world.advance()
                for axis in axes:
                    tick = self._world.tick + 12_000
                    self._world.at(tick, lambda axis=axis: self._motion.end_stream(axis))


class StreamsShake(Mutant):
    breaks = ("AxisDriver.stream/position", "wrong value")
    found_by = "test_streams.py::test_a_slow_stream_is_followed"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            super().stream(position + (0.001 if count % 2 else -0.001), velocity, due_ns)


class BiasAfterReopen(Mutant):
    breaks = ("DeviceDriver.open/connects", "after re-open")
    found_by = "test_connection.py::test_it_works_again_after_it_was_closed"

    class Device(SimDevice):
        def close(self) -> None:
            self.simulation.__dict__["closed"] = True
            super().close()

    class Axes(ReadAnew):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            bias = 0.005 if self._simulation.__dict__.get("closed") else 0.0
            super().move(axis, target + bias, profile)


class PositionSpikes(Mutant):
    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_units.py::test_the_velocity_is_the_slope_of_the_position"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 300 == 0:
                image.position[-1] += 0.02


class StampsJumpAhead(Mutant):
    breaks = ("AxisDriver.read/fresh", "wrong value")
    found_by = "test_ageing.py::test_values_are_fresh"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 20 == 0:
                image.fresh_ns += 9_000_000


class NoVelocityWhileStreaming(Mutant):
    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = "test_stops_of_some_axes.py::test_a_stop_reaches_each_named_axis_of_a_stream"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity[image.operation == Operation.STREAM] = 0.0


class HomeDoneForAll(Mutant):
    breaks = ("AxisDriver.read/states", "wrong axis")
    found_by = "test_neighbours.py::test_the_home_position_of_one_axis"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.home_done[:] = image.home_done.any()


class SecondCodeIsZero(Mutant):
    breaks = ("AxisDriver.read/alarms", "ignored")
    found_by = "test_feedback.py::test_the_code_is_that_of_the_present_alarm"

    class Axes(ReadAnew):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            if self._states.amp_alarm[axis]:
                self.__dict__.setdefault("known", set()).add(axis)
            super().clear_alarm(axis, timeout_s)

        def read(self, image: ProcessImage) -> None:
            super().read(image)
            for axis in self.__dict__.get("known", ()):
                image.alarm_code[axis] = 0


class AllOfflineTogether(Mutant):
    breaks = ("AxisDriver.read/states", "wrong axis")
    found_by = "test_faults.py::test_a_drive_that_is_lost_is_offline"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.offline[:] = image.offline.any()


class ShowsTheWantedServo(Mutant):
    breaks = ("AxisDriver.read/states", "wrong value")
    found_by = ""

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.servo_on[:] = self._states.servo_wanted | image.servo_on


class FreshAfterClose(Mutant):
    breaks = ("AxisDriver.read/fresh", "ignored")
    found_by = "test_ageing.py::test_a_dead_bus_does_not_look_alive"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            if image.fresh_ns:
                image.fresh_ns = self._simulation.world.now_ns


class SecondOpenFailsOnce(Mutant):
    breaks = ("DeviceDriver.open/connects", "second call")
    found_by = "test_reopening.py::test_opening_twice_before_communication_has_no_effect"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            opened = self.__dict__["opened"] = int(self.__dict__.get("opened", 0)) + 1
            if opened == 2:
                raise ConnectError("busy", {"engine": "busy"})
            super().open(path, name)


class BitsOfTheFirstByte(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "wrong value")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            super().write_output_bit(0, bit, value)


class LastOutputInverted(Mutant):
    breaks = ("IoDriver.read_outputs/bytes", "wrong value")
    found_by = "test_io.py::test_a_bit_leaves_its_neighbours_alone"

    class Io(SimIo):
        def read_outputs(self, byte: int, length: int) -> bytes:
            found = bytearray(super().read_outputs(byte, length))
            if byte + length == self.output_bytes and length:
                found[-1] ^= 0x80
            return bytes(found)


class FirstInputBitMissing(Mutant):
    breaks = ("IoDriver.read_inputs/bytes", "wrong value")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Io(SimIo):
        def read_inputs(self, byte: int, length: int) -> bytes:
            return bytes(value & 0xFE for value in super().read_inputs(byte, length))


class WritesOnlySet(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "wrong value")
    found_by = "test_io.py::test_bytes_leave_their_neighbours_alone"

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            before = self.read_outputs(byte, len(data))
            merged = bytes(old | new for old, new in zip(before, data, strict=True))
            super().write_outputs(byte, merged)


class NodesWithTwoAxes(Mutant):
    breaks = ("FieldbusDriver.status/status", "wrong value")
    found_by = "test_fieldbus.py::test_the_nodes_have_as_many_axes_as_the_bus"

    class Fieldbus(SimFieldbus):
        def status(self, bus: int) -> BusStatus:
            found = super().status(bus)
            nodes = tuple(replace(node, axes=2 * node.axes) for node in found.nodes)
            return replace(found, nodes=nodes)


class SubindexIgnored(Mutant):
    breaks = ("FieldbusDriver.read_object/value", "wrong value")
    found_by = "test_fieldbus.py::test_objects_are_those_of_the_status"

    class Fieldbus(SimFieldbus):
        def read_object(self, bus: int, node: int, index: int, subindex: int) -> bytes:
            return super().read_object(bus, node, index, min(subindex, 1))


class WritesTheNextObject(Mutant):
    breaks = ("FieldbusDriver.write_object/writes", "wrong value")
    found_by = "test_fieldbus.py::test_a_written_object_is_in_its_node"

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            shifted = 0x6066 if index == 0x6068 else index
            super().write_object(bus, node, shifted, subindex, data)


class RegistersInFours(Mutant):
    breaks = ("FieldbusDriver.read_register/memory", "wrong value")
    found_by = "test_fieldbus.py::test_registers_have_the_length_that_was_asked_for"

    class Fieldbus(SimFieldbus):
        def read_register(self, bus: int, node: int, address: int, length: int) -> bytes:
            return super().read_register(bus, node, address, 4 * (length + 3 >> 2))


class CountsNoMoreAfterAReset(Mutant):
    breaks = ("FieldbusDriver.reset_statistics/zero", "side effect")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Fieldbus(SimFieldbus):
        def reset_statistics(self, bus: int) -> None:
            super().reset_statistics(bus)
            self.__dict__["off"] = True

        def status(self, bus: int) -> BusStatus:
            found = super().status(bus)
            return replace(found, lost_frames=0) if self.__dict__.get("off") else found


class EachStopLeavesAThread(Mutant):
    breaks = ("AxisDriver.stop/rests", "side effect")
    found_by = "test_leaks.py::test_nothing_grows_with_each_command"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            super().stop(axes)
            ended = threading.Event()
            threading.Thread(target=ended.wait, args=(20.0,), daemon=True).start()


class StopWaitsForServos(Mutant):
    breaks = ("drivers/timeouts", "blocks")
    found_by = "test_threads.py::test_commands_to_all_axes_at_once"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            with self.__dict__.setdefault("gate", threading.Lock()):
                super().servo(axis, on, timeout_s)
                time.sleep(0.1)

        def read(self, image: ProcessImage) -> None:
            with self.__dict__.setdefault("gate", threading.Lock()):
                super().read(image)


class StreamsRaiseNowAndThen(Mutant):
    breaks = ("drivers/loop", "raises")
    found_by = "test_process.py::test_a_period_needs_no_room"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            count = self.__dict__["count"] = int(self.__dict__.get("count", 0)) + 1
            if count % 300 == 0:
                raise ValueError("overflow")
            super().stream(position, velocity, due_ns)


class EachMoveLeavesMemory(Mutant):
    breaks = ("AxisDriver.move/starts", "leaks")
    found_by = "test_leaks.py::test_nothing_grows_with_each_command"

    class Axes(SimAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.__dict__.setdefault("history", []).append(np.zeros(2000))


class SlowMovesStutter(Mutant):
    """Below 0.1 rad/s an axis moves in steps of 1.5 mrad."""

    breaks = ("AxisDriver.read/commands", "wrong value")
    found_by = "test_small_and_large.py::test_a_slow_move_is_as_slow_as_it_was_asked_for"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            slow = (np.abs(image.velocity_command) < 0.1) & (image.velocity_command != 0.0)
            image.position_command[slow] = np.rint(image.position_command[slow] / 0.003) * 0.003
