"""Mutants: Open, close, start and stop, again and in motion."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd.api import ConnectionState, NotReady, Profile
from robotd_sim import SimAxes, SimDevice, SimFaultInjector


class OpenResets(Mutant):
    breaks = ("DeviceDriver.open/again", "side effect")
    found_by = "test_reopening.py::test_opening_an_open_device_has_no_effect"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            self.close()
            super().open(path, name)


class OpenAgainRaises(Mutant):
    breaks = ("DeviceDriver.open/again", "raises")
    found_by = "test_reopening.py::test_opening_an_open_device_has_no_effect"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            if self.state() is not ConnectionState.IDLE:
                raise NotReady("it is open")
            super().open(path, name)


class OpenAgainSwitchesOff(Mutant):
    breaks = ("DeviceDriver.open/again", "side effect")
    found_by = "test_reopening.py::test_opening_an_open_device_has_no_effect"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            with self.simulation.world.lock:
                for axis in range(self.simulation.axes):
                    self.simulation.power.turn_off(axis)


class CloseLetsAxesGoOn(Mutant):
    breaks = ("DeviceDriver.close/axes-stop", "ignored")
    found_by = "test_reopening.py::test_axes_in_motion_stop_when_the_device_ends"

    class Device(SimDevice):
        def close(self) -> None:
            with self.simulation.world.lock:
                self.simulation.world.advance()
                self.simulation.engine = ConnectionState.IDLE


class CloseLetsTheLastAxisGoOn(Mutant):
    breaks = ("DeviceDriver.close/axes-stop", "last axis")
    found_by = "test_reopening.py::test_axes_in_motion_stop_when_the_device_ends"

    class Device(SimDevice):
        def close(self) -> None:
            simulation, last = self.simulation, self.simulation.axes - 1
            with simulation.world.lock:
                simulation.world.advance()
                speed = float(simulation.servo.command_velocity[last])
            super().close()
            with simulation.world.lock:
                here = float(simulation.servo.position[last])
                simulation.servo.place(last, here, here, speed)
                simulation.motion.coast(last, 0.02)


class ClosesLater(Mutant):
    breaks = ("DeviceDriver.close/disconnects", "late")
    found_by = "test_connection.py::test_closing_while_axes_move_is_orderly"

    class Device(SimDevice):
        def close(self) -> None:
            world = self.simulation.world
            with world.lock:
                world.advance()
                world.at(world.tick + 200, self.simulation.reset)


class CloseTwiceRaises(Mutant):
    breaks = ("DeviceDriver.close/twice", "raises")
    found_by = "test_connection.py::test_closing_a_device_twice_or_unopened_is_no_error"

    class Device(SimDevice):
        def close(self) -> None:
            if self.state() is ConnectionState.IDLE:
                raise NotReady("it is closed")
            super().close()


class ServosSurviveClose(Mutant):
    breaks = ("DeviceDriver.close/disconnects", "survives close")
    found_by = "test_reopening.py::test_a_command_does_not_outlive_its_connection"

    class Device(SimDevice):
        def close(self) -> None:
            self.__dict__["on"] = self.simulation.states.servo_on.copy()
            super().close()

        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                for axis in np.flatnonzero(self.__dict__.pop("on", [])):
                    self.simulation.power.request(int(axis), on=True)


class JogSurvivesClose(Mutant):
    breaks = ("DeviceDriver.start_communication/nothing-moves", "survives close")
    found_by = "test_reopening.py::test_a_command_does_not_outlive_its_connection"

    class Axes(SimAxes):
        def jog(self, axis: int, profile: Profile) -> None:
            super().jog(axis, profile)
            self.__dict__.setdefault("jogs", {})[axis] = profile

        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            was_on = self._states.servo_on[axis]
            super().servo(axis, on, timeout_s)
            profile = self.__dict__.get("jogs", {}).pop(axis, None) if on and not was_on else None
            if profile is not None and profile.velocity:
                with self._world.lock:
                    self._motion.jog(axis, profile)


class StateFromACache(Mutant):
    breaks = ("DeviceDriver.state/now", "stale")
    found_by = "test_connection.py::test_the_states_follow_the_calls"

    class Device(SimDevice):
        def state(self) -> ConnectionState:
            now, known = self.simulation.clock.now_ns(), self.__dict__.get("known")
            if known is None or now - known[0] > 300_000_000:
                known = self.__dict__["known"] = (now, super().state())
            return known[1]


class LostLinkNotShown(Mutant):
    breaks = ("DeviceDriver.state/lost-link", "ignored")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"

    class Device(SimDevice):
        started = False

        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.started = True

        def stop_communication(self, timeout_s: float) -> None:
            self.started = False
            super().stop_communication(timeout_s)

        def close(self) -> None:
            self.started = False
            super().close()

        def state(self) -> ConnectionState:
            return ConnectionState.COMMUNICATING if self.started else super().state()


class CannotResume(Mutant):
    breaks = ("DeviceDriver.start_communication/resumes", "ignored")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"

    class Device(SimDevice):
        broken = False

        def start_communication(self, timeout_s: float) -> None:
            if self.simulation.network.packet_loss:
                raise NotReady("the link was lost")
            super().start_communication(timeout_s)


class MovesWhenTheLinkReturns(Mutant):
    breaks = ("DeviceDriver.start_communication/nothing-moves", "survives close")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"
    says = "an axis moves without a command when the link returns"

    class Injector(SimFaultInjector):
        def drop_communication(self) -> None:
            super().drop_communication()
            self._simulation.__dict__["dropped"] = True

    class Axes(SimAxes):
        def servo(self, axis: int, on: bool, timeout_s: float) -> None:
            super().servo(axis, on, timeout_s)
            simulation = self._simulation
            if on and simulation.__dict__.get("dropped"):
                with simulation.world.lock:
                    position = float(simulation.servo.position[axis]) + 0.01
                    simulation.servo.place(axis, position, position, 0.0)
                    simulation.motion.hold(axis, position)


class FaultWhileAllIsWell(Mutant):
    breaks = ("DeviceDriver.fault/reason", "wrong value")
    found_by = "test_ageing.py::test_the_device_says_at_once_why_it_is_silent"

    class Device(SimDevice):
        def fault(self) -> str:
            return super().fault() or "no fault"


class ScanOfTheStart(Mutant):
    breaks = ("DeviceDriver.scan_network/summary", "stale")
    found_by = "test_fieldbus.py::test_a_lost_drive_is_missing_in_a_scan"

    class Device(SimDevice):
        def scan_network(self) -> str:
            return str(self.__dict__.setdefault("scan", super().scan_network()))


class ScanStopsAxes(Mutant):
    breaks = ("DeviceDriver.scan_network/summary", "side effect")
    found_by = "test_questions.py::test_questions_change_nothing"

    class Device(SimDevice):
        def scan_network(self) -> str:
            with self.simulation.world.lock:
                for axis in range(self.simulation.axes):
                    self.simulation.motion.stop(axis)
            return super().scan_network()


class StopLeavesTheLastServoOn(Mutant):
    breaks = ("DeviceDriver.stop_communication/axes-stop", "last axis")
    found_by = "test_connection.py::test_servos_are_off_after_communication_stopped"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            was = self.__dict__.pop("on", False)
            super().start_communication(timeout_s)
            if was:
                with self.simulation.world.lock:
                    self.simulation.power.request(self.simulation.axes - 1, on=True)

        def stop_communication(self, timeout_s: float) -> None:
            self.__dict__["on"] = bool(self.simulation.states.servo_on[-1])
            super().stop_communication(timeout_s)


class StopLetsAxesGoOn(Mutant):
    breaks = ("DeviceDriver.stop_communication/axes-stop", "ignored")
    found_by = "test_connection.py::test_servos_are_off_after_communication_stopped"

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            with self.simulation.world.lock:
                self.simulation.world.advance()
                if self.simulation.communicating:
                    self.simulation.engine = ConnectionState.RUNNING


class StopReturnsBeforeTheEnd(Mutant):
    breaks = ("DeviceDriver.stop_communication/ends", "late")
    found_by = "test_leaks.py::test_nothing_grows_with_each_start"

    class Device(SimDevice):
        def stop_communication(self, timeout_s: float) -> None:
            world = self.simulation.world
            with world.lock:
                world.advance()
                world.at(world.tick + 150, self.simulation.silence)


class StartEnablesTheLastAxis(Mutant):
    breaks = ("DeviceDriver.start_communication/nothing-moves", "side effect")
    found_by = "test_connection.py::test_starting_enables_and_moves_nothing"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            with self.simulation.world.lock:
                self.simulation.power.request(self.simulation.axes - 1, on=True)


class StartReturnsEarly(Mutant):
    breaks = ("DeviceDriver.start_communication/starts", "late")
    found_by = "test_connection.py::test_the_states_follow_the_calls"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            with self.simulation.world.lock:
                self.simulation.world.advance()
                if self.simulation.engine is ConnectionState.IDLE:
                    raise NotReady("no device is open")
                self.simulation.request_communication()


class StartLeavesAThread(Mutant):
    """One thread with each start; all of them end when the device is closed."""

    breaks = ("DeviceDriver.start_communication/starts", "leaks")
    found_by = "test_leaks.py::test_nothing_grows_with_each_start"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            ended = self.__dict__.setdefault("ended", threading.Event())
            threading.Thread(target=ended.wait, args=(60.0,), daemon=True).start()

        def close(self) -> None:
            self.__dict__.pop("ended", threading.Event()).set()
            super().close()


class StartLeavesMemory(Mutant):
    breaks = ("DeviceDriver.start_communication/starts", "leaks")
    found_by = "test_leaks.py::test_nothing_grows_with_each_start"

    class Device(SimDevice):
        def start_communication(self, timeout_s: float) -> None:
            super().start_communication(timeout_s)
            self.__dict__.setdefault("buffers", []).append(bytearray(50_000))


class OpenLeavesMemory(Mutant):
    breaks = ("DeviceDriver.open/connects", "leaks")
    found_by = "test_leaks.py::test_nothing_grows_with_each_start"

    class Device(SimDevice):
        def open(self, path: str = "", name: str = "") -> None:
            super().open(path, name)
            self.__dict__.setdefault("nodes", []).extend({"node": node} for node in range(200))


class AlarmsLostAfterReopen(Mutant):
    breaks = ("DeviceDriver.open/connects", "after re-open")
    found_by = "test_reopening.py::test_everything_works_again"

    class Device(SimDevice):
        def close(self) -> None:
            if self.state() is not ConnectionState.IDLE:
                self.simulation.__dict__["deaf"] = True
            super().close()

    class Injector(SimFaultInjector):
        def trip(self, axis: int, code: int) -> None:
            if not self._simulation.__dict__.get("deaf"):
                super().trip(axis, code)


class DumpOfTheStart(Mutant):
    breaks = ("DeviceDriver.dump_parameters/text", "stale")
    found_by = "test_connection.py::test_a_good_parameter_file_is_in_force_axis_by_axis"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            dumps = self.__dict__.setdefault("dumps", {})
            return str(dumps.setdefault(axis, super().dump_parameters(axis)))


class DumpingStopsTheAxis(Mutant):
    breaks = ("DeviceDriver.dump_parameters/text", "side effect")
    found_by = "test_questions.py::test_questions_change_nothing"

    class Device(SimDevice):
        def dump_parameters(self, axis: int) -> str:
            with self.simulation.world.lock:
                self.simulation.motion.stop(axis)
            return super().dump_parameters(axis)


class WrongFileIsAValueError(Mutant):
    breaks = ("DeviceDriver.load_parameters/wrong-file", "raises")
    found_by = "test_parameters.py::test_a_file_without_axes_of_the_robot_changes_no_axis"

    class Device(SimDevice):
        def load_parameters(self, path: Path) -> str:
            try:
                return super().load_parameters(path)
            except Exception as error:
                raise ValueError("bad file") from error
