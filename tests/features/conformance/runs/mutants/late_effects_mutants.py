"""Mutants: calls with an effect some time after they have returned."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import CommandMode, ConnectionState, Operation, OperationError, Profile
from robotd_sim import SimAxes, SimDevice, SimFieldbus, SimIo, Simulation

DELAY_TICKS = 300  # 0.3 s: the kit waits 0.1 s for what a call does at once
POLL_TICKS = 10
LONG_TICKS = 20_000  # longer than the kit waits for anything
STEP_RAD = 0.01
SLOW = Profile(0.1, 1.0, 1.0)

THEME = "test_late_effects.py::test_"
NO_EFFECT = THEME + "what_has_no_effect_has_none_later"
SERVO = THEME + "a_servo_stays_as_it_was_switched"
MODE = THEME + "a_mode_stays_as_it_was_set"
MOTION = THEME + "motion_that_has_ended_does_not_begin_again"
WAITS = THEME + "a_stream_without_setpoints_does_not_move_later"
STREAM = THEME + "a_stream_goes_on_until_it_is_ended"
ALARM = THEME + "a_cleared_alarm_does_not_come_back"
START = THEME + "a_start_has_no_later_effects"
HOMED = THEME + "an_axis_stays_where_it_was_homed"
SCALE = THEME + "a_scale_stays_as_it_was_set"
OUTPUTS = THEME + "outputs_stay_as_they_were_written"
FIELDBUS = THEME + "the_fieldbus_does_nothing_later"


def schedule(simulation: Simulation, action: Callable[[], object], ticks: int) -> None:
    """Do ``action`` after ``ticks``. Hold the world's lock, as every action of its agenda does."""
    world = simulation.world
    world.at(world.tick + ticks, lambda: action() and None)


def in_a_while(
    simulation: Simulation, action: Callable[[], object], ticks: int = DELAY_TICKS
) -> None:
    """Do ``action`` in the simulation after ``ticks``; it must not take the world's lock."""
    with simulation.world.lock:
        simulation.world.advance()
        schedule(simulation, action, ticks)


def after_rest(simulation: Simulation, axis: int, action: Callable[[], object]) -> None:
    """Do ``action`` ``DELAY_TICKS`` after ``axis`` has come to rest; under the world's lock."""

    def wait() -> None:
        moves = simulation.world.moves(axis)
        schedule(simulation, wait if moves else action, POLL_TICKS if moves else DELAY_TICKS)

    schedule(simulation, wait, POLL_TICKS)


def creep(simulation: Simulation, axis: int) -> None:
    """Start a short move of ``axis``, whatever its state."""
    here = float(simulation.servo.command[axis])
    simulation.motion.move(axis, here + STEP_RAD, SLOW)


class LateAxes(SimAxes):
    """Axes with ``later``."""

    def __init__(self, simulation: Simulation) -> None:
        super().__init__(simulation)
        self._enabled_before: set[int] = set()

    def enables_again(self, axis: int, on: bool) -> bool:
        """Return whether this is a further enabling of an axis that is off; note the first."""
        again = on and axis in self._enabled_before and not self._states.servo_on[axis]
        if on:
            self._enabled_before.add(axis)
        return again

    def later(self, action: Callable[[], object]) -> None:
        in_a_while(self._simulation, action)

    def creep_later(self, axis: int) -> None:
        self.later(lambda: creep(self._simulation, axis))

    def later_at_rest(self, axis: int, action: Callable[[], object]) -> None:
        in_a_while(self._simulation, lambda: after_rest(self._simulation, axis, action), 1)

    def creep_from_rest(self, axis: int) -> None:
        self.later_at_rest(axis, lambda: creep(self._simulation, axis))

    def off_later(self, axis: int) -> None:
        self.later(lambda: self._simulation.power.turn_off(axis))


class EnablingAgainSwitchesOffLater(Mutant):
    breaks = ("AxisDriver.servo/enabled", "late")
    found_by = NO_EFFECT

    class Axes(LateAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = bool(self._states.servo_on[axis])
            super().servo(axis, on, timeout_s)
            if on and was_on:
                self.off_later(axis)


class ClearingSwitchesOffLater(Mutant):
    breaks = ("AxisDriver.clear_alarm/idle", "late")
    found_by = NO_EFFECT

    class Axes(LateAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            idle = bool(self._states.servo_on[axis]) and not self._states.amp_alarm[axis]
            super().clear_alarm(axis, timeout_s)
            if idle:
                self.off_later(axis)


class EndOfNoStreamMovesLater(Mutant):
    breaks = ("AxisDriver.end_stream/idle", "late")
    found_by = NO_EFFECT

    class Axes(LateAxes):
        def end_stream(self, axes: Sequence[int]) -> None:
            idle = [axis for axis in axes if self._states.operation[axis] == Operation.IDLE]
            super().end_stream(axes)
            for axis in idle:
                self.creep_later(axis)


class LateDevice(SimDevice):
    """A device with ``later``."""

    def later(self, action: Callable[[], object]) -> None:
        in_a_while(self.simulation, action)


class StartAgainSwitchesOffLater(Mutant):
    breaks = ("DeviceDriver.start_communication/again", "late")
    found_by = NO_EFFECT

    class Device(LateDevice):
        def start_communication(self, timeout_s: float) -> None:
            was = self.state() is ConnectionState.COMMUNICATING
            super().start_communication(timeout_s)
            if was:
                self.later(lambda: self.simulation.power.turn_off(0))


class OpenAgainSwitchesOffLater(Mutant):
    breaks = ("DeviceDriver.open/again", "late")
    found_by = NO_EFFECT

    class Device(LateDevice):
        def open(self, path: str = "", name: str = "") -> None:
            was = self.state() is not ConnectionState.IDLE
            super().open(path, name)
            if was:
                self.later(lambda: self.simulation.power.turn_off(0))


class EnabledForAWhile(Mutant):
    breaks = ("AxisDriver.servo/switches", "late")
    found_by = SERVO

    class Axes(LateAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            again = self.enables_again(axis, on)
            super().servo(axis, on, timeout_s)
            if again:
                self.off_later(axis)


class DisabledForAWhile(Mutant):
    breaks = ("AxisDriver.servo/disables", "late")
    found_by = SERVO

    class Axes(LateAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            if not on:
                self.later(lambda: self._simulation.power.request(axis, on=True))


class JumpsLaterWhenEnabled(Mutant):
    breaks = ("AxisDriver.servo/no-jump", "late")
    found_by = SERVO

    class Axes(LateAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            again = self.enables_again(axis, on)
            super().servo(axis, on, timeout_s)
            if again:
                self.creep_later(axis)


class NeighbourFollowsLater(Mutant):
    breaks = ("AxisDriver/others", "late")
    found_by = MOTION

    class Axes(LateAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            if axis == 0:
                self.later_at_rest(0, lambda: creep(self._simulation, 1))


class StartSwitchesOnLater(Mutant):
    breaks = ("AxisDriver/servos", "late")
    found_by = START

    class Device(LateDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.later(lambda: self.simulation.power.request(0, on=True))


class StartMovesLater(Mutant):
    breaks = ("DeviceDriver.start_communication/nothing-moves", "late")
    found_by = START

    class Device(LateDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.later(lambda: creep(self.simulation, 0))


class ClearingAnAlarmMovesLater(Mutant):
    breaks = ("AxisDriver/resumption", "late")
    found_by = ALARM

    class Axes(LateAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            had = bool(self._states.amp_alarm[axis])
            super().clear_alarm(axis, timeout_s)
            if had:
                self.creep_later(axis)


class AlarmComesBackLater(Mutant):
    breaks = ("AxisDriver.clear_alarm/clears", "late")
    found_by = ALARM

    class Axes(LateAxes):
        def clear_alarm(self, axis: int, timeout_s: float) -> None:
            code = int(self._states.alarm_code[axis])
            super().clear_alarm(axis, timeout_s)
            if code:
                self.later(lambda: self._simulation.power.trip(axis, code))


class ModeForAWhile(Mutant):
    breaks = ("AxisDriver.set_command_mode/changes", "late")
    found_by = MODE

    class Axes(LateAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            before = int(self._states.mode[axis])
            super().set_command_mode(axis, mode)
            self.later(lambda: self._restore(axis, before))

        def _restore(self, axis: int, mode: int) -> None:
            self._states.mode[axis] = self._states.mode_feedback[axis] = mode


class MovesLaterInItsNewMode(Mutant):
    breaks = ("AxisDriver.set_command_mode/nothing-moves", "late")
    found_by = MODE

    class Axes(LateAxes):
        def set_command_mode(self, axis: int, mode: CommandMode) -> None:
            super().set_command_mode(axis, mode)
            self.creep_later(axis)


class MovesFurtherLater(Mutant):
    breaks = ("AxisDriver/as-commanded", "late")
    found_by = MOTION

    class Axes(LateAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            super().move(axis, target, profile)
            self.creep_from_rest(axis)


class RejectedMovesAreMadeLater(Mutant):
    breaks = ("AxisDriver.move/while-stopping", "late")
    found_by = MOTION

    class Axes(LateAxes):
        def move(self, axis: int, target: float, profile: Profile) -> None:
            try:
                super().move(axis, target, profile)
            except OperationError:
                self.later_at_rest(axis, lambda: self._motion.move(axis, target, profile))
                raise


class SecondStopGoesOnLater(Mutant):
    breaks = ("AxisDriver.stop/again", "late")
    found_by = MOTION

    class Axes(LateAxes):
        def stop(self, axes: Sequence[int]) -> None:
            again = [axis for axis in axes if self._states.operation[axis] == Operation.STOPPING]
            super().stop(axes)
            for axis in again:
                self.creep_from_rest(axis)


class QuickStopGoesOnLater(Mutant):
    breaks = ("AxisDriver.quick_stop/takes-over", "late")
    found_by = MOTION

    class Axes(LateAxes):
        def quick_stop(self, axes: Sequence[int]) -> None:
            taken = [axis for axis in axes if self._states.operation[axis] == Operation.STOPPING]
            super().quick_stop(axes)
            for axis in taken:
                self.creep_from_rest(axis)


class StreamCreepsLater(Mutant):
    breaks = ("AxisDriver.begin_stream/waits", "late")
    found_by = WAITS

    class Axes(LateAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            for axis in axes:
                self.creep_later(axis)


class StreamEndsLater(Mutant):
    breaks = ("AxisDriver.begin_stream/operation", "late")
    found_by = STREAM

    class Axes(LateAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            super().begin_stream(axes)
            for axis in axes:
                self.later(lambda axis=axis: self._motion.end_stream(axis))


class StreamBegunAgainEndsLater(Mutant):
    breaks = ("AxisDriver.begin_stream/again", "late")
    found_by = STREAM

    class Axes(LateAxes):
        def begin_stream(self, axes: Sequence[int]) -> None:
            again = [axis for axis in axes if self._states.operation[axis] == Operation.STREAM]
            super().begin_stream(axes)
            for axis in again:
                self.later(lambda axis=axis: self._motion.end_stream(axis))


class HomeOfALaterPosition(Mutant):
    breaks = ("AxisDriver.home/zero", "late")
    found_by = HOMED

    class Axes(LateAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            was = float(self._simulation.servo.position[axis])
            super().home(axis, timeout_s)
            self.later(lambda: self._lose(axis, was))

        def _lose(self, axis: int, position: float) -> None:
            scaling = self._simulation.scaling
            home = scaling.home.copy()
            home[axis] -= position * scaling.gain[axis]
            self._simulation._rescale(scaling.origin, home)


class HomingMovesLater(Mutant):
    breaks = ("AxisDriver.home/no-motion", "late")
    found_by = HOMED

    class Axes(LateAxes):
        def home(self, axis: int, timeout_s: float) -> None:
            super().home(axis, timeout_s)
            self.creep_later(axis)


class LateScale(LateAxes):
    """Axes with ``scale_later``."""

    def scale_later(self, axis: int, name: str, factor: float) -> None:
        value = float(self._simulation.parameters[name][axis]) * factor
        self.later(lambda: self._rescale(axis, {name: value}))

    def _rescale(self, axis: int, changes: dict[str, float]) -> None:
        simulation = self._simulation
        simulation.parameters = simulation.parameters.with_values(
            {name: {axis: value} for name, value in changes.items()}
        )
        simulation._rescale(simulation.scaling.origin, simulation.scaling.home)


class HomingTurnsLater(Mutant):
    breaks = ("AxisDriver.home/scale", "late")
    found_by = HOMED

    class Axes(LateScale):
        def home(self, axis: int, timeout_s: float) -> None:
            super().home(axis, timeout_s)
            self.scale_later(axis, "AxisPolarity", -1.0)


class PolarityForAWhile(Mutant):
    breaks = ("AxisDriver.set_polarity/sets", "late")
    found_by = SCALE

    class Axes(LateScale):
        def set_polarity(self, axis: int, polarity: int) -> None:
            super().set_polarity(axis, polarity)
            self.scale_later(axis, "AxisPolarity", -1.0)


class PolarityIsMeasuredLater(Mutant):
    breaks = ("AxisDriver.set_polarity/measured", "late")
    found_by = SCALE

    class Axes(LateScale):
        def set_polarity(self, axis: int, polarity: int) -> None:
            self.later(lambda: self._rescale(axis, {"AxisPolarity": polarity}))


class PolarityChangesTheGearLater(Mutant):
    breaks = ("AxisDriver.set_polarity/ratio", "late")
    found_by = SCALE

    class Axes(LateScale):
        def set_polarity(self, axis: int, polarity: int) -> None:
            super().set_polarity(axis, polarity)
            self.scale_later(axis, "AxisGearRatioNumerator", 2.0)


class GearRatioForAWhile(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/counts", "late")
    found_by = SCALE

    class Axes(LateScale):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            super().set_gear_ratio(axis, numerator, denominator)
            self.scale_later(axis, "AxisGearRatioNumerator", 0.5)


class GearRatioTurnsLater(Mutant):
    breaks = ("AxisDriver.set_gear_ratio/polarity", "late")
    found_by = SCALE

    class Axes(LateScale):
        def set_gear_ratio(self, axis: int, numerator: float, denominator: float) -> None:
            super().set_gear_ratio(axis, numerator, denominator)
            self.scale_later(axis, "AxisPolarity", -1.0)


class OutputsForAWhile(Mutant):
    breaks = ("IoDriver.write_outputs/bytes", "late")
    found_by = OUTPUTS

    class Io(SimIo):
        def write_outputs(self, byte: int, data: bytes) -> None:
            before = self.read_outputs(byte, len(data))
            super().write_outputs(byte, data)
            image = self._simulation.io
            in_a_while(self._simulation, lambda: image.write(byte, before))


class OutputBitForAWhile(Mutant):
    breaks = ("IoDriver.write_output_bit/bit", "late")
    found_by = OUTPUTS

    class Io(SimIo):
        def write_output_bit(self, byte: int, bit: int, value: bool) -> None:
            before = self.read_outputs(byte, 1)
            super().write_output_bit(byte, bit, value)
            image = self._simulation.io
            in_a_while(self._simulation, lambda: image.write(byte, before))


class WritingAnObjectSwitchesOffLater(Mutant):
    breaks = ("FieldbusDriver.write_object/nothing-moves", "late")
    found_by = FIELDBUS

    class Fieldbus(SimFieldbus):
        def write_object(self, bus: int, node: int, index: int, subindex: int, data: bytes) -> None:
            super().write_object(bus, node, index, subindex, data)
            in_a_while(self._simulation, lambda: self._simulation.power.turn_off(0))


class NodesJoinFarTooLate(Mutant):
    breaks = ("FieldbusDriver.start_hot_connect/joins", "late")
    found_by = "test_lost_nodes.py::test_a_hot_connect_takes_in_all_nodes_each_time"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            in_a_while(self._simulation, self._simulation.reconnect, LONG_TICKS)


class CountersComeBackLater(Mutant):
    breaks = ("FieldbusDriver.reset_statistics/zero", "late")
    found_by = FIELDBUS

    class Fieldbus(SimFieldbus):
        def reset_statistics(self, bus: int) -> None:
            super().reset_statistics(bus)
            network, world = self._simulation.network, self._simulation.world
            in_a_while(self._simulation, lambda: network.lose_packets(world.tick, 1))
