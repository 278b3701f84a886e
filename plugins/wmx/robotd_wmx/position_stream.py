"""Streamed positions: setpoints for the engine's cyclic buffers.

The binding interpolates and sends in a thread of its own (``src/position_stream.hpp``); here it
is bound to the device that is open now. Where the SDK has no cyclic buffer nothing is streamed.
"""

from __future__ import annotations

from collections.abc import Sequence

from robotd.api import FloatArray
from robotd_wmx import _native
from robotd_wmx._native import Device
from robotd_wmx.connection import WmxConnection


class PositionStream:
    """Axes in position mode that obey ``put``.

    ``put`` and ``ran_dry`` are for the control-loop thread, everything else for any thread.
    """

    def __init__(self, connection: WmxConnection) -> None:
        self._connection = connection
        self._of: Device | None = None
        self._native: _native.PositionStream | None = None

    @property
    def available(self) -> bool:
        """The SDK has cyclic buffers, and the descriptor does not forbid them."""
        return _native.CYCLIC_BUFFER and self._connection.options.stream_positions

    @property
    def running(self) -> bool:
        """Streams were begun on the device that is open now."""
        return self._native is not None

    @property
    def fault(self) -> str:
        """The reason why the engine ended a stream; "" for none since the last ``begin``."""
        return self._native.fault if self._native else ""

    def active(self, axis: int) -> bool:
        return self._native is not None and self._native.active(axis)

    def stopping(self, axis: int) -> bool:
        return self._native is not None and self._native.stopping(axis)

    def put(self, position: FloatArray, velocity: FloatArray, due_ns: int) -> None:
        """See ``AxisDriver.stream``."""
        if self._native is not None:
            self._native.put(position, velocity, due_ns)

    def ran_dry(self, due_ns: int) -> bool:
        """See ``AxisDriver.stream_ran_dry``."""
        return self._native is not None and self._native.ran_dry(due_ns)

    def begin(self, axes: Sequence[int]) -> None:
        """Let ``axes`` obey from where their commands are. Raises CallError."""
        self._bind().begin(list(axes))

    def stop(self, axes: Sequence[int]) -> list[int]:
        """Slow down with each axis' own deceleration; returns the axes that were streamed."""
        return self._end(axes, quick=False)

    def quick_stop(self, axes: Sequence[int]) -> list[int]:
        """Stop with QuickStopDec, where the SDK's cyclic buffers can; else as ``stop``."""
        return self._end(axes, quick=True)

    def close(self) -> None:
        """End all streams and close the buffers; the axes stand by now."""
        native, self._native, self._of = self._native, None, None
        if native is not None:
            native.close()

    def _end(self, axes: Sequence[int], *, quick: bool) -> list[int]:
        if self._native is None:
            return []
        streamed = [axis for axis in axes if self._native.active(axis)]
        if streamed:
            (self._native.quick_stop if quick else self._native.stop)(streamed)
        return streamed

    def _bind(self) -> _native.PositionStream:
        device = self._connection.stream
        if self._native is None or self._of is not device:
            self.close()
            robot, options = self._connection.robot, self._connection.options
            scaling = self._connection.scaling
            self._of = device
            self._native = _native.PositionStream(
                device,
                scaling.units.tolist(),
                (scaling.velocity * scaling.units).tolist(),
                (scaling.stop_deceleration * scaling.units).tolist(),
                1.0 / robot.cycle.rate_hz,
                options.stream_buffer_s,
                robot.cycle.realtime_priority,
            )
        return self._native
