"""Things that go wrong, on request: for tests and demonstrations."""

from __future__ import annotations

from robotd.plugin.api import InvalidArgument, NotReady
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

    def freeze(self, frozen: bool) -> None:
        """No value arrives any more, and nothing says so; the axes go on with what they do."""
        with self._world.lock:
            self._world.advance()
            self._simulation.network.frozen = frozen

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        """A sensor on the I/O module changes."""
        with self._world.lock:
            self._world.advance()
            inputs = self._simulation.io.inputs
            inputs[byte] = inputs[byte] & ~(1 << bit) | int(value) << bit

    def push(self, axis: int, position: float) -> None:
        """Somebody puts an axis elsewhere by hand. Raises NotReady while its servo is on."""
        with self._world.lock:
            self._world.advance()
            if self._simulation.states.servo_on[axis]:
                raise NotReady(f"axis {axis}: cannot be moved by hand while the servo is on")
            if not -1e6 < position < 1e6:
                raise InvalidArgument(f"axis {axis}: {position:g} rad is out of reach")
            self._simulation.servo.place(axis, position, position, 0.0)
            self._simulation.motion.hold(axis, position)
