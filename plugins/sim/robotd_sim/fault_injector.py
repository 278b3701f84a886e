"""The world around the simulated robot, for conformance checks and scenarios."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robotd.api import ConnectionState, FaultInjector, InvalidArgument, NotReady, Operation
from robotd_sim.simulation import Simulation


class SimFaultInjector(FaultInjector):
    """Breaks a simulation. Any thread may call; each call takes effect at the present tick."""

    uses_context_clock = True

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._world = simulation, simulation.world

    def position(self, axis: int) -> float:
        with self._now() as simulation:
            return float(simulation.servo.position[axis])

    def torque(self, axis: int) -> float:
        with self._now() as simulation:
            return simulation.servo.measure(simulation.servo.state())[1][axis]

    def move_by_hand(self, axis: int, delta: float) -> None:
        """Raises NotReady while the servo of the axis is on, unless it is guided by hand."""
        with self._now() as simulation:
            guided = simulation.states.operation[axis] == Operation.GUIDING
            if simulation.states.servo_on[axis] and not guided:
                raise NotReady("cannot be moved by hand while the servo is on", axis=axis)
            position = float(simulation.servo.position[axis]) + delta
            if not -1e6 < position < 1e6:
                raise InvalidArgument(f"{position:g} rad is out of reach", axis=axis)
            if guided:
                simulation.motion.guide(axis, position)
            else:
                self._place(axis, position)

    def trip(self, axis: int, code: int) -> None:
        with self._now() as simulation:
            simulation.power.trip(axis, code)

    def disconnect(self, axis: int) -> None:
        with self._now() as simulation:
            simulation.disconnect(axis)

    def reconnect(self, axis: int) -> None:
        """A slave is taken in again by ``start_hot_connect``, its plug alone does nothing."""
        with self._now() as simulation:
            simulation.network.slaves[axis].plugged = True

    def freeze(self, frozen: bool) -> None:
        """Freeze the values without an error; the axes continue their motion."""
        with self._now() as simulation:
            simulation.network.frozen = frozen

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        with self._now() as simulation:
            inputs = simulation.io.inputs
            inputs[byte] = inputs[byte] & ~(1 << bit) | int(value) << bit

    def output_bit(self, byte: int, bit: int) -> bool:
        with self._world.lock:
            return bool(self._simulation.io.outputs[byte] >> bit & 1)

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        with self._now() as simulation:
            simulation.io.stick(byte, bit, value)

    def block(self, axis: int, blocked: bool) -> None:
        with self._now() as simulation:
            simulation.servo.grip(axis, held=blocked)
            if blocked and not simulation.states.servo_on[axis]:  # what coasts ends here
                self._place(axis, float(simulation.servo.position[axis]))
            self._world.stir()

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        with self._now() as simulation:
            simulation.switches.press(axis, switch, pressed=pressed)
            simulation.guards.refresh()
            self._world.stir()

    def jump_encoder(self, axis: int, delta: float) -> None:
        with self._now() as simulation:
            position = simulation.servo.position
            position[axis] += delta
            if simulation.states.servo_on[axis]:
                self._world.stir()
            else:
                self._place(axis, float(position[axis]))

    def lose_packets(self, count: int) -> None:
        """Lose ``count`` frames in a row: no values for as many ticks."""
        with self._now() as simulation:
            simulation.network.lose_packets(self._world.tick, count)

    def drop_communication(self) -> None:
        with self._now() as simulation:
            simulation.network.packet_loss += 1
            if simulation.communicating:
                simulation.lost_because = "communication has ended by itself"
            simulation.silence()

    def stop_engine(self) -> None:
        """End the engine at once, as if its process had died."""
        with self._now() as simulation:
            if simulation.engine is not ConnectionState.IDLE:
                simulation.reset()
                simulation.lost_because = "the engine has ended by itself"

    @contextmanager
    def _now(self) -> Iterator[Simulation]:
        """Lock the simulation at the present tick."""
        with self._world.lock:
            self._world.advance()
            yield self._simulation

    def _place(self, axis: int, position: float) -> None:
        """Put an axis whose servo is off at rest to ``position``."""
        self._simulation.servo.place(axis, position, position, 0.0)
        self._simulation.motion.hold(axis, position)
