"""Switch of the servos: on after every check, off in any state."""

from __future__ import annotations

import contextvars
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, suppress
from typing import Protocol

import numpy as np

from robotd.clock import Clock
from robotd.clock.simulated import SimulatedClock
from robotd.device.connection import Connection
from robotd.device.drivers import AxisDriver
from robotd.device.image_waits import FIRST_VALUES_TIMEOUT_S, ImageWaits
from robotd.device.process_image import ProcessImage
from robotd.device.state import ConnectionState
from robotd.device.stop_latch import StopLatch
from robotd.errors import DeviceTimeout, NotReady, RobotdError

_OFF_MEANWHILE = "its servo was switched off meanwhile"
CLOSED = (ConnectionState.IDLE, ConnectionState.SHUTDOWN)


class SwitchedAxes(Protocol):
    """Members of ``Axes`` that the switch of its servos uses."""

    names: tuple[str, ...]
    image: ProcessImage
    connection: Connection
    stop_latch: StopLatch
    clock: Clock

    def check_numbers(self, axes: Sequence[int]) -> None: ...
    def check_axes(self, axes: Sequence[int]) -> None: ...
    def check_unclaimed(self, axis: int) -> None: ...
    def servo_group(self, axis: int) -> tuple[int, ...]: ...
    def servo(self, axis: int, on: bool) -> None: ...
    def fault_error(self, axis: int, advice: str = "") -> NotReady: ...
    def error(self, kind: type[NotReady], axis: int, reason: str) -> NotReady: ...
    def naming(self, axis: int | None = None) -> AbstractContextManager[None]: ...


class ServoSwitch:
    """Switches servos for ``Axes``, which says what is checked. Any worker."""

    def __init__(self, axes: SwitchedAxes, driver: AxisDriver, waits: ImageWaits) -> None:
        self._axes, self._driver, self._waits = axes, driver, waits
        self._offs = [0] * len(axes.names)  # number of times that each was switched off

    @property
    def offs(self) -> Sequence[int]:
        """Number of times that each servo was switched off. Any thread."""
        return tuple(self._offs)

    def enable(self, axis: int, offs: Sequence[int] | None = None) -> None:
        """Switch on at the measured position; see ``Axes.servo``.

        ``offs``: when it was asked for; None: now.
        """
        axes, connection = self._axes, self._axes.connection
        axes.check_axes([axis])
        axes.stop_latch.check_servos()
        group, timeout_s = axes.servo_group(axis), connection.settings.servo_timeout_s
        offs, on = self.offs if offs is None else offs, axes.image.servo_on
        with axes.naming(axis), connection.scaling_lock:
            connection.require_ready()
            connection.require_alive()
            self._require_position(group)
            for other in group:
                if axes.image.amp_alarm[other]:
                    raise axes.fault_error(other, "; clear it first")
                if not on[other]:
                    axes.check_unclaimed(other)
            if any(self._offs[other] != offs[other] for other in group):
                raise axes.error(NotReady, axis, _OFF_MEANWHILE)
            try:
                self._driver.servo(axis, True, timeout_s)
            except DeviceTimeout:
                # A call that was given up may go on: the drive must not enable later.
                if not on[axis]:
                    with suppress(RobotdError):
                        self._driver.servo(axis, False, timeout_s)
                raise
            # A request to end, to be inactive, or to switch off may have come meanwhile.
            is_off = any(self._offs[other] != offs[other] for other in group)
            if connection.ending or not axes.stop_latch.servos_allowed or is_off:
                self._driver.servo(axis, False, timeout_s)
                connection.require_alive()
                axes.stop_latch.check_servos()
                raise axes.error(NotReady, axis, _OFF_MEANWHILE)
        self._waits.until(lambda: bool(on[list(group)].all()))

    def disable(self, axis: int) -> None:
        """Switch off in any state of an open device. Raises NotReady: nothing confirms it."""
        axes, connection = self._axes, self._axes.connection
        axes.stop_latch.check_commandable()
        axes.check_numbers([axis])
        group, on = list(axes.servo_group(axis)), axes.image.servo_on
        for other in group:
            self._offs[other] += 1
        if connection.state in CLOSED:
            raise NotReady(connection.rejection)
        with axes.naming(axis):
            self._driver.servo(axis, False, connection.settings.servo_timeout_s)
        sent_ns = axes.clock.now_ns()

        def is_off() -> bool:
            return self._waits.is_newer(sent_ns) and not bool(on[group].any())

        self._waits.until(is_off, FIRST_VALUES_TIMEOUT_S)
        if not is_off():
            why = "the drive reports it on"
            if not self._waits.is_newer(sent_ns):
                why = connection.rejection if not connection.ready else "no new values have come"
            raise axes.error(NotReady, axis, f"servo off was sent and is not confirmed: {why}")

    def _require_position(self, group: Sequence[int]) -> None:
        """Wait for the first positions of a new connection; raise NotReady where one is missing.

        An axis is enabled at its measured position: at an unknown one it would jump.
        """
        axes, image = self._axes, self._axes.image
        self._waits.until(
            lambda: bool(np.isfinite(image.position[list(group)]).all()),
            at_least_s=FIRST_VALUES_TIMEOUT_S,
        )
        for axis in group:
            if not math.isfinite(image.position[axis]):
                known = image.fault(axis) or "the device has not reported it"
                raise axes.error(NotReady, axis, f"position is not known: {known}")


def switch_off(axes: SwitchedAxes, numbers: Sequence[int]) -> Mapping[int, Exception | None]:
    """Switch servos off at the same time; return the error of each axis, None: it is off. Worker.

    A drive that does not answer does not delay the others.
    """

    def off(axis: int) -> Exception | None:
        try:
            axes.servo(axis, False)
        except Exception as error:  # noqa: BLE001 - the caller reports every axis
            return error
        return None

    if isinstance(axes.clock, SimulatedClock):  # which one thread waits on
        return {axis: off(axis) for axis in numbers}
    if not numbers:
        return {}
    with ThreadPoolExecutor(len(numbers), thread_name_prefix="robotd-servo-off") as threads:
        calls = {
            axis: threads.submit(contextvars.copy_context().run, off, axis) for axis in numbers
        }
        return {axis: call.result() for axis, call in calls.items()}
