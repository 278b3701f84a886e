"""Mutants of fault injectors: a test bench that does not do what it was asked for."""

from __future__ import annotations

from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd_sim import SimFaultInjector


class HandsThatTurnNothing(Mutant):
    breaks = ("FaultInjector.move_by_hand/stays", "ignored")
    found_by = "test_enable.py::test_a_move_by_hand_is_seen"

    class Injector(SimFaultInjector):
        def move_by_hand(self, axis: int, delta: float) -> None:
            pass


class TripsOnce(Mutant):
    breaks = ("FaultInjector.trip/until", "second call")
    found_by = "test_feedback.py::test_the_code_is_that_of_the_present_alarm"

    class Injector(SimFaultInjector):
        def trip(self, axis: int, code: int) -> None:
            if self.__dict__.setdefault("code", code) == code:
                super().trip(axis, code)


class PullsThePlugBeside(Mutant):
    breaks = ("FaultInjector.disconnect/silent", "wrong axis")
    found_by = "test_fieldbus.py::test_the_lost_node_is_the_one_that_was_lost"

    class Injector(SimFaultInjector):
        def disconnect(self, axis: int) -> None:
            super().disconnect((axis + 1) % self._simulation.axes)


class FreezesNothing(Mutant):
    breaks = ("FaultInjector.freeze/frozen", "ignored")
    found_by = "test_ageing.py::test_a_dead_bus_does_not_look_alive"

    class Injector(SimFaultInjector):
        def freeze(self, frozen: bool) -> None:
            pass


class SensorsAreInverted(Mutant):
    breaks = ("FaultInjector.set_input_bit/sensor", "wrong value")
    found_by = "test_io.py::test_each_input_is_at_its_address"

    class Injector(SimFaultInjector):
        def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
            super().set_input_bit(byte, bit, not value)


class LampsOfTheFirstLook(Mutant):
    breaks = ("FaultInjector.output_bit/lamp", "stale")
    found_by = "test_io.py::test_outputs_are_at_the_terminals"

    class Injector(SimFaultInjector):
        def output_bit(self, byte: int, bit: int) -> bool:
            seen: dict[tuple[int, int], bool] = self.__dict__.setdefault("seen", {})
            return seen.setdefault((byte, bit), super().output_bit(byte, bit))


class SticksNothing(Mutant):
    breaks = ("FaultInjector.stick_output_bit/sticks", "ignored")
    found_by = "test_io.py::test_a_stuck_output_obeys_again_when_it_is_released"

    class Injector(SimFaultInjector):
        def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
            pass


class StuckOutputsAreNeverReleased(Mutant):
    breaks = ("FaultInjector.stick_output_bit/sticks", "side effect")
    found_by = "test_io.py::test_a_stuck_output_obeys_again_when_it_is_released"

    class Injector(SimFaultInjector):
        def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
            if value is not None:
                super().stick_output_bit(byte, bit, value)


class BlocksTheAxisBeside(Mutant):
    breaks = ("FaultInjector.block/held", "wrong axis")
    found_by = "test_feedback.py::test_a_blocked_axis_is_measured_where_it_is"

    class Injector(SimFaultInjector):
        def block(self, axis: int, blocked: bool) -> None:
            super().block((axis + 1) % self._simulation.axes, blocked)


class EncodersJumpTooFar(Mutant):
    breaks = ("FaultInjector.jump_encoder/jumps", "wrong value")
    found_by = "test_feedback.py::test_a_jump_of_the_encoder_is_seen"

    class Injector(SimFaultInjector):
        def jump_encoder(self, axis: int, delta: float) -> None:
            super().jump_encoder(axis, 2.0 * delta)


class PressesTheSwitchBeside(Mutant):
    breaks = ("FaultInjector.press_switch/switch", "wrong axis")
    found_by = "test_switches.py::test_a_closed_switch_is_shown_alone_until_it_is_released"

    class Injector(SimFaultInjector):
        def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
            super().press_switch((axis + 1) % self._simulation.axes, switch, pressed)


class TorqueInMillinewtonMetres(Mutant):
    breaks = ("FaultInjector.torque/torque", "wrong value")
    found_by = "test_feedback.py::test_torque_is_in_newton_metres"

    class Injector(SimFaultInjector):
        def torque(self, axis: int) -> float:
            return 1000.0 * super().torque(axis)


class LosesNoPackets(Mutant):
    breaks = ("FaultInjector.lose_packets/lost", "ignored")
    found_by = "test_fieldbus.py::test_lost_frames_are_counted_until_a_reset"

    class Injector(SimFaultInjector):
        def lose_packets(self, count: int) -> None:
            pass


class CommunicationGoesOn(Mutant):
    breaks = ("FaultInjector.drop_communication/broken", "ignored")
    found_by = "test_reopening.py::test_a_lost_link_is_shown_and_resumed"

    class Injector(SimFaultInjector):
        def drop_communication(self) -> None:
            pass


class EnginesLiveForEver(Mutant):
    breaks = ("FaultInjector.stop_engine/dies", "ignored")
    found_by = "test_reopening.py::test_a_device_that_died_can_be_opened_again"

    class Injector(SimFaultInjector):
        def stop_engine(self) -> None:
            pass
