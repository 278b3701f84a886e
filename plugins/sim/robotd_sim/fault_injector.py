"""The world around the simulated robot, for conformance checks and scenarios."""

from __future__ import annotations

from robotd.api import FaultInjector
from robotd_sim.faults import Faults
from robotd_sim.simulation import Simulation


class SimFaultInjector(FaultInjector):
    """Everything that a bench can do. Any thread may call."""

    uses_context_clock = True

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._world = simulation, simulation.world
        self._faults = Faults(simulation)

    def position(self, axis: int) -> float:
        with self._world.lock:
            self._world.advance()
            return float(self._simulation.servo.position[axis])

    def move_by_hand(self, axis: int, delta: float) -> None:
        self._faults.push(axis, self.position(axis) + delta)

    def trip(self, axis: int, code: int) -> None:
        self._faults.trip(axis, code)

    def disconnect(self, axis: int) -> None:
        self._faults.disconnect(axis)

    def reconnect(self, axis: int) -> None:
        """A slave is taken in again by ``start_hot_connect``, its plug alone does nothing."""

    def freeze(self, frozen: bool) -> None:
        self._faults.freeze(frozen)

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        self._faults.set_input_bit(byte, bit, value)

    def output_bit(self, byte: int, bit: int) -> bool:
        with self._world.lock:
            return bool(self._simulation.io.outputs[byte] >> bit & 1)

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        self._faults.stick_output_bit(byte, bit, value)

    def block(self, axis: int, blocked: bool) -> None:
        self._faults.block(axis, blocked)

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        self._faults.press_switch(axis, switch, pressed)

    def torque(self, axis: int) -> float:
        with self._world.lock:
            self._world.advance()
            return self._simulation.servo.measure(self._simulation.servo.state())[1][axis]

    def jump_encoder(self, axis: int, delta: float) -> None:
        self._faults.jump_encoder(axis, delta)

    def lose_packets(self, count: int) -> None:
        self._faults.lose_packets(count)

    def drop_communication(self) -> None:
        self._faults.drop_communication()

    def stop_engine(self) -> None:
        self._faults.stop_engine()
