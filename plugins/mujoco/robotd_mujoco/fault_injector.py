"""The world around the simulated robot, for conformance checks and scenarios."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robotd.api import FaultInjector, InvalidArgument
from robotd_mujoco.physics import Physics


class MujocoFaultInjector(FaultInjector):
    """Faults that the physics has. Any thread may call; each takes effect at the present step.

    There are no switches at the axes, and the link loses all frames or none.
    """

    uses_context_clock = True

    def __init__(self, physics: Physics) -> None:
        self._physics = physics

    def position(self, axis: int) -> float:
        with self._now() as physics:
            return float(physics.positions()[axis])

    def move_by_hand(self, axis: int, delta: float) -> None:
        with self._now() as physics:
            if physics.servo_on[axis] and not physics.let_go[axis]:
                raise InvalidArgument("the servo holds the axis")
            physics.turn(axis, delta)

    def trip(self, axis: int, code: int) -> None:
        with self._now() as physics:
            physics.trip(axis, code)

    def disconnect(self, axis: int) -> None:
        with self._now() as physics:
            physics.connect(axis, connected=False)

    def reconnect(self, axis: int) -> None:
        with self._now() as physics:
            physics.connect(axis, connected=True)

    def freeze(self, frozen: bool) -> None:
        with self._now() as physics:
            physics.frozen = frozen

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        with self._now() as physics:
            physics.set_input(byte, bit, value=value)

    def output_bit(self, byte: int, bit: int) -> bool:
        return bool(self._physics.outputs[byte] >> bit & 1)

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        with self._now() as physics:
            if value is None:
                physics.stuck_outputs.pop((byte, bit), None)
            else:
                physics.stuck_outputs[byte, bit] = value
                physics.keep_stuck()

    def block(self, axis: int, blocked: bool) -> None:
        with self._now() as physics:
            physics.block(axis, blocked=blocked)

    def jump_encoder(self, axis: int, delta: float) -> None:
        with self._now() as physics:
            physics.encoder_offset[axis] += delta

    def torque(self, axis: int) -> float:
        with self._now() as physics:
            return float(physics.torques()[axis])

    def drop_communication(self) -> None:
        with self._now() as physics:
            if physics.talking:
                physics.lost_because = "communication has ended by itself"
            physics.silence()

    def stop_engine(self) -> None:
        with self._now() as physics:
            physics.silence()
            physics.is_open = False
            physics.lost_because = "the simulation has ended by itself"

    @contextmanager
    def _now(self) -> Iterator[Physics]:
        """Lock the physics at the present step."""
        with self._physics.lock:
            self._physics.advance()
            yield self._physics
