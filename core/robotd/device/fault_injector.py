"""Fault injection: inputs and faults that normally need hands-on access."""

from __future__ import annotations

from robotd.errors import Unsupported


class FaultInjector:
    """Optional handle for tests and scenarios: the outside world of a device.

    Called by one worker thread, or on a simulated backend by the control loop: then it must not
    block. A simulation fills all of it; a test stand may fill what it can. What is not overridden
    answers ``Unsupported``, and the checks that need it are skipped with that reason.

    Attributes:
        uses_context_clock: the device has no time but ``DeviceContext.clock`` and no thread of its
            own, so that tests may run it on a clock that they advance themselves.
        in_process: the device is simulated in this process and ends with it.
    """

    uses_context_clock: bool = False
    in_process: bool = True

    def position(self, axis: int) -> float:
        """True position of the axis in rad or m, independent of the drive."""
        raise self._unsupported("position")

    def move_by_hand(self, axis: int, delta: float) -> None:
        """Turn an axis whose servo is off by ``delta`` rad or m; it stays there."""
        raise self._unsupported("move_by_hand")

    def trip(self, axis: int, code: int) -> None:
        """Let the drive report the alarm ``code`` (> 0) until it is cleared."""
        raise self._unsupported("trip")

    def disconnect(self, axis: int) -> None:
        """Pull the plug of one drive: it stops answering."""
        raise self._unsupported("disconnect")

    def reconnect(self, axis: int) -> None:
        """Put the plug back; the drive may need ``start_hot_connect`` to be taken in again."""
        raise self._unsupported("reconnect")

    def freeze(self, frozen: bool) -> None:
        """Let no further value arrive, without the device saying so; False: they arrive again."""
        raise self._unsupported("freeze")

    def set_input_bit(self, byte: int, bit: int, value: bool) -> None:
        """Let a sensor change one bit of the input image; Unsupported: no module has it."""
        raise self._unsupported("set_input_bit")

    def output_bit(self, byte: int, bit: int) -> bool:
        """Return the level of one output, as a lamp at its terminal shows it."""
        raise self._unsupported("output_bit")

    def stick_output_bit(self, byte: int, bit: int, value: bool | None) -> None:
        """Let one output keep ``value`` whatever is written to it; None: it obeys again."""
        raise self._unsupported("stick_output_bit")

    def block(self, axis: int, blocked: bool) -> None:
        """Hold an axis where it is, whatever is commanded, or let it go."""
        raise self._unsupported("block")

    def jump_encoder(self, axis: int, delta: float) -> None:
        """Let the measured position jump by ``delta`` rad or m, as a slipping encoder does."""
        raise self._unsupported("jump_encoder")

    def press_switch(self, axis: int, switch: str, pressed: bool) -> None:
        """Close or release a switch at the axis: the name of its row in ``ProcessImage``.

        ``negative_limit``, ``positive_limit`` or ``home_switch``.
        """
        raise self._unsupported("press_switch")

    def torque(self, axis: int) -> float:
        """Return the torque of the motor at the axis, N·m (or N)."""
        raise self._unsupported("torque")

    def lose_packets(self, count: int) -> None:
        """Lose ``count`` frames of the fieldbus in a row."""
        raise self._unsupported("lose_packets")

    def drop_communication(self) -> None:
        """Break the cyclic exchange; the engine itself stays."""
        raise self._unsupported("drop_communication")

    def stop_engine(self) -> None:
        """Let the engine die."""
        raise self._unsupported("stop_engine")

    def _unsupported(self, method: str) -> Unsupported:
        return Unsupported(f"FaultInjector.{method}")
