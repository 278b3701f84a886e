"""Mutants: Wrong only while something happens, to one axis, again, or far from zero."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant, ReadAnew

from robotd.api import ConnectError, FloatArray, NotReady, Operation, ProcessImage, Profile
from robotd_sim import SimAxes, SimDevice, SimFieldbus

HERE = "test_while_it_happens.py::test_"
JOG = f"{HERE}a_velocity_command_is_met_and_shown_exactly"
LOST = f"{HERE}one_lost_axis_leaves_the_values_of_the_others"
FAR = f"{HERE}every_kind_of_motion_is_right_far_from_zero"
ALARM = f"{HERE}an_alarm_of_the_next_connection_has_its_own_code"
CURVED = f"{HERE}no_setpoint_of_a_curved_stream_is_left_out"
STOPPED = f"{HERE}what_is_stopped_is_not_shown_as_a_move"
CONFIRMED = "test_lost_nodes.py::test_a_drive_is_confirmed_to_be_off_where_it_answers"
CAUTIONS = "test_questions.py::test_each_caution_is_a_line_of_text"
FAR_RAD = 2.0


class JogsFivePercentLow(Mutant):
    breaks = ("AxisDriver.jog/starts", "wrong value")
    found_by = JOG
    says = "change of the position"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, replace(profile, velocity=0.95 * profile.velocity))


class ShowsJogsFivePercentLow(Mutant):
    """The measured velocity alone, during velocity commands."""

    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = JOG
    says = "measured velocity"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.velocity[image.operation == Operation.VELOCITY] *= 0.95


class StopOfAJogShownAsAMove(Mutant):
    breaks = ("AxisDriver.read/mode", "wrong value")
    found_by = STOPPED
    says = "shows a move"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            image.operation[image.operation == Operation.STOPPING] = Operation.POSITION


class StopsStreamsWithoutARamp(Mutant):
    breaks = ("AxisDriver.stop/stream", "ignored")
    found_by = f"{HERE}a_stop_in_a_stream_has_a_ramp"
    says = "to rest within a period"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            for axis in axes:
                if self._states.operation[axis] == Operation.STREAM:
                    self._motion.brake(axis, 1e5)
            super().stop(axes)


class EveryFifthSetpointLeftOut(Mutant):
    breaks = ("AxisDriver.stream/setpoint", "ignored")
    found_by = CURVED
    says = "are left out"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            count = self.__dict__["count"] = self.__dict__.get("count", 0) + 1
            if count % 5:
                super().stream(position, velocity, due_ns)


class JogsAreScaledFarFromZero(Mutant):
    breaks = ("AxisDriver.jog/starts", "wrong value")
    found_by = FAR
    says = "a jog of"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            far = abs(float(self._simulation.servo.command[axis])) > FAR_RAD
            super().jog(axis, replace(profile, velocity=(0.5 if far else 1.0) * profile.velocity))


class StreamsInStepsFarFromZero(Mutant):
    """Setpoints in the resolution of a float of 16 bits."""

    breaks = ("AxisDriver.stream/position", "wrong value")
    found_by = FAR
    says = "differ|from its target"

    class Axes(SimAxes):
        def stream(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
            far = np.abs(position) > FAR_RAD
            coarse = np.round(position * 64.0) / 64.0 + 0.008
            super().stream(np.where(far, coarse, position), velocity, due_ns)


class AllStaleWhileOneIsLost(Mutant):
    breaks = ("AxisDriver.read/fresh", "stale")
    found_by = LOST
    says = "s newer in|stale|not ready|joint|not within"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            before_ns = image.fresh_ns
            super().read(image)
            if image.offline.any():
                image.fresh_ns = before_ns


class ReadFailsWhileOneIsLost(Mutant):
    """Once in ten periods."""

    breaks = ("drivers/loop", "raises")
    found_by = LOST

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            count = self.__dict__["count"] = self.__dict__.get("count", 0) + 1
            if image.offline.any() and count % 10 == 0:
                raise KeyError("node")


class OffsetAfterAHotConnect(Mutant):
    """Positions of the axis that was lost are 0.02 rad off when it is back."""

    breaks = ("AxisDriver.read/measured", "wrong value")
    found_by = LOST
    says = "differ"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            lost = self.__dict__.setdefault("lost", np.zeros(len(image.offline), bool))
            lost |= image.offline
            off = lost & ~image.offline
            image.position[off] += 0.02
            image.position_command[off] += 0.02


class FirstCodeOfAnAlarmSticks(Mutant):
    """For all later alarms of its axis, also in the next connection."""

    breaks = ("AxisDriver.read/alarms", "stale")
    found_by = ALARM
    says = "its alarm is"

    class Axes(ReadAnew):
        def read(self, image: ProcessImage) -> None:
            super().read(image)
            codes = self.__dict__.setdefault("codes", {})
            for axis in np.flatnonzero(image.alarm_code).tolist():
                image.alarm_code[axis] = codes.setdefault(axis, int(image.alarm_code[axis]))


class FirstOpenAfterACrashFails(Mutant):
    breaks = ("DeviceDriver.open/connects", "after re-open")
    found_by = f"{HERE}the_first_attempt_after_the_end_of_the_engine_connects"
    says = "still locked"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            if self.__dict__.pop("crashed", False):
                raise ConnectError("still locked", {"engine": "by the connection before"})
            super().open(path, name)

        def close(self) -> None:
            self.__dict__["crashed"] = bool(self.simulation.lost_because)
            super().close()


class HotConnectOnce(Mutant):
    """A second lost drive is not taken in."""

    breaks = ("FieldbusDriver.start_hot_connect/joins", "second call")
    found_by = "test_lost_nodes.py::test_a_hot_connect_takes_in_all_nodes_each_time"

    class Fieldbus(SimFieldbus):
        def start_hot_connect(self, bus: int) -> None:
            if not self.__dict__.get("joined"):
                self.__dict__["joined"] = True
                super().start_hot_connect(bus)


class _KeepsConfirmations(SimAxes):
    """Which drives were there when they were last read."""

    def read(self, image: ProcessImage) -> None:
        super().read(image)
        self.__dict__["there"] = (~image.offline).tolist()

    def confirmed_off(self) -> list[bool] | None:
        return list(self.__dict__.get("there", ()))


class LostDrivesAreConfirmedOff(Mutant):
    breaks = ("AxisDriver.confirmed_off/confirmed", "wrong value")
    found_by = CONFIRMED
    says = "drives that answer"

    class Axes(_KeepsConfirmations):
        def confirmed_off(self) -> list[bool] | None:
            return [True] * self._simulation.axes


class LastDriveIsNeverConfirmed(Mutant):
    breaks = ("AxisDriver.confirmed_off/confirmed", "last axis")
    found_by = CONFIRMED
    says = "drives that answer"

    class Axes(_KeepsConfirmations):
        def confirmed_off(self) -> list[bool] | None:
            return [*(super().confirmed_off() or [])[:-1], False]


class CautionsInOneText(Mutant):
    breaks = ("AxisDriver.cautions/dangers", "wrong value")
    found_by = CAUTIONS
    says = "list of texts"

    class Axes(SimAxes):
        @property
        def cautions(self) -> Sequence[str]:
            return "the drives have no brake"


class CautionsNeedTheDevice(Mutant):
    breaks = ("AxisDriver.cautions/known", "raises")
    found_by = CAUTIONS

    class Axes(SimAxes):
        @property
        def cautions(self) -> Sequence[str]:
            if not self._simulation.communicating:
                raise NotReady("the drives are not read yet")
            return ()


class StopsNeedFreshValues(Mutant):
    breaks = ("AxisDriver.stop/starts", "ignored")
    found_by = f"{HERE}a_stop_needs_no_fresh_values"
    says = "without fresh values"

    class Axes(SimAxes):
        def stop(self, axes: Sequence[int]) -> None:
            if not self._simulation.network.frozen:
                super().stop(axes)

        def quick_stop(self, axes: Sequence[int]) -> None:
            if not self._simulation.network.frozen:
                super().quick_stop(axes)


class OffNeedsAllDrivesWell(Mutant):
    breaks = ("AxisDriver.servo/disables", "ignored")
    found_by = f"{HERE}a_servo_goes_off_while_another_drive_is_lost_or_in_alarm"

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            if not on and self._states.amp_alarm.any():
                raise NotReady("another drive is in alarm", axis=axis)
            super().servo(axis, on, timeout_s)
