"""The world around the simulated robot, for conformance checks and scenarios."""

from __future__ import annotations

from robotd.api import FaultInjector, InvalidArgument
from robotd_mujoco.physics import Physics


class MujocoFaultInjector(FaultInjector):
    """Faults that the physics has. Any thread may call.

    There are no switches at the axes, and the link loses all frames or none.
    """

    uses_context_clock = True

    def __init__(self, physics: Physics) -> None:
        self._physics = physics

    def position(self, axis: int) -> float:
        with self._physics.lock:
            self._physics.advance()
            return float(self._physics.positions()[axis])

    def move_by_hand(self, axis: int, delta: float) -> None:
        with self._physics.lock:
            self._physics.advance()
            if self._physics.servo_on[axis]:
                raise InvalidArgument("the servo holds the axis")
            self._physics.turn(axis, delta)

    def trip(self, axis: int, code: int) -> None:
        with self._physics.lock:
            self._physics.advance()
            self._physics.trip(axis, code)

    def disconnect(self, axis: int) -> None:
        with self._physics.lock:
            self._physics.advance()
            self._physics.connect(axis, connected=False)

    def reconnect(self, axis: int) -> None:
        with self._physics.lock:
            self._physics.connect(axis, connected=True)

    def freeze(self, frozen: bool) -> None:
        with self._physics.lock:
            self._physics.frozen = frozen

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        with self._physics.lock:
            self._physics.set_input(byte, bit, value=value)

    def output_bit(self, byte: int, bit: int) -> bool:
        return bool(self._physics.outputs[byte] >> bit & 1)

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        with self._physics.lock:
            if value is None:
                self._physics.stuck_outputs.pop((byte, bit), None)
            else:
                self._physics.stuck_outputs[byte, bit] = value
                self._physics.keep_stuck()

    def block(self, axis: int, blocked: bool) -> None:
        with self._physics.lock:
            self._physics.advance()
            self._physics.block(axis, blocked=blocked)

    def jump_encoder(self, axis: int, delta: float) -> None:
        with self._physics.lock:
            self._physics.encoder_offset[axis] += delta

    def torque(self, axis: int) -> float:
        with self._physics.lock:
            self._physics.advance()
            return float(self._physics.torques()[axis])

    def drop_communication(self) -> None:
        with self._physics.lock:
            if self._physics.talking:
                self._physics.lost_because = "communication has ended by itself"
            self._physics.silence()

    def stop_engine(self) -> None:
        with self._physics.lock:
            self._physics.silence()
            self._physics.is_open = False
            self._physics.lost_because = "the simulation has ended by itself"
