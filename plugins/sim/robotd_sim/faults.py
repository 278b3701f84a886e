"""Things that go wrong, on request: for tests and demonstrations."""

from __future__ import annotations

from robotd.api import ConnectionState, InvalidArgument, NotReady
from robotd_sim.simulation import Simulation


class Faults:
    """Breaks a simulation. Any thread may call; each call takes effect at the present tick."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation, self._world = simulation, simulation.world

    def trip(self, axis: int, code: int) -> None:
        """The drive of ``axis`` goes into alarm ``code``."""
        with self._world.lock:
            self._world.advance()
            self._simulation.power.trip(axis, code)

    def disconnect(self, slave: int) -> None:
        """``slave`` stops answering until a hot connect."""
        with self._world.lock:
            self._world.advance()
            self._simulation.disconnect(slave)

    def drop_communication(self) -> None:
        """The cyclic exchange breaks down; the engine is left Running."""
        with self._world.lock:
            self._world.advance()
            self._simulation.network.packet_loss += 1
            self._simulation.silence()

    def stop_engine(self) -> None:
        """The engine ends at once, as if its process had died."""
        with self._world.lock:
            self._world.advance()
            if self._simulation.engine is not ConnectionState.IDLE:
                self._simulation.reset()

    def lose_packets(self, count: int) -> None:
        """Lose ``count`` frames in a row: no values for as many ticks."""
        with self._world.lock:
            self._world.advance()
            network = self._simulation.network
            network.packet_loss += count
            network.frozen = True
            self._world.at(self._world.tick + count, network.thaw)

    def block(self, axis: int, blocked: bool) -> None:
        """Something holds ``axis`` where it is, or lets it go."""
        with self._world.lock:
            self._world.advance()
            self._simulation.servo.grip(axis, held=blocked)
            self._world.stir()

    def jump_encoder(self, axis: int, delta: float) -> None:
        """The measured position of ``axis`` is another by ``delta`` from one tick to the next."""
        with self._world.lock:
            self._world.advance()
            simulation = self._simulation
            simulation.servo.position[axis] += delta
            if simulation.states.servo_on[axis]:
                self._world.stir()
            else:
                position = float(simulation.servo.position[axis])
                simulation.servo.place(axis, position, position, 0.0)
                simulation.motion.hold(axis, position)

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        """One output keeps ``value`` whatever is written to it; None: normal again."""
        with self._world.lock:
            self._world.advance()
            self._simulation.io.stick(byte, bit, value)

    def freeze(self, frozen: bool) -> None:
        """Freeze the values without an error; the axes continue their motion."""
        with self._world.lock:
            self._world.advance()
            self._simulation.network.frozen = frozen

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        """A sensor on the I/O module changes."""
        with self._world.lock:
            self._world.advance()
            inputs = self._simulation.io.inputs
            inputs[byte] = inputs[byte] & ~(1 << bit) | int(value) << bit

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        """A limit or home switch of ``axis`` closes wherever the axis is, or is released."""
        with self._world.lock:
            self._world.advance()
            self._simulation.switches.press(axis, switch, pressed=pressed)
            self._simulation.guards.refresh()
            self._world.stir()

    def push(self, axis: int, position: float) -> None:
        """Move an axis by hand. Raises NotReady while its servo is on."""
        with self._world.lock:
            self._world.advance()
            if self._simulation.states.servo_on[axis]:
                raise NotReady("cannot be moved by hand while the servo is on", axis=axis)
            if not -1e6 < position < 1e6:
                raise InvalidArgument(f"{position:g} rad is out of reach", axis=axis)
            self._simulation.servo.place(axis, position, position, 0.0)
            self._simulation.motion.hold(axis, position)
