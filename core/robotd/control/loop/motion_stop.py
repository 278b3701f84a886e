"""Controlled stop of all motion, by command or by an input. No safety function."""

from __future__ import annotations

from collections.abc import Callable

from robotd.clock import wait_until
from robotd.control.loop.setpoint_mixer import SetpointMixer
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor.io_settings import StopInputSettings
from robotd.device.axes import Axes
from robotd.device.io import Io
from robotd.device.process_image import ProcessImage
from robotd.device.state import Operation
from robotd.errors import DeviceTimeout, NotReady, RobotdError

BY_DEVICE = (Operation.POSITION, Operation.VELOCITY, Operation.HOMING, Operation.GUIDING)
QUICK_STOP_TIMEOUT_S = 1.0  # for what a controlled stop has not brought to rest


class MotionStop:
    """Ends all motion while the latch is engaged, and engages it by an input.

    Setpoint sources come to rest along their paths, moves, jogs and homing by their own ramps.
    Hand guiding ends. A motion that the device begins after its call has timed out is stopped, too.

    ``stop_input``: forbids motion, and counts while the device is ready; None: there is none.
    """

    def __init__(
        self, axes: Axes, mixer: SetpointMixer, io: Io, stop_input: StopInputSettings | None
    ) -> None:
        self._axes, self._mixer = axes, mixer
        self._connection, self._clock = axes.connection, axes.clock
        self._was_active = False  # at the start of the period
        self._shown = True  # the image is newer than the end of all sources
        self._input_name = ""
        self._forbids_motion: Callable[[], bool] = lambda: False  # by the input
        if stop_input is not None:
            level, byte, bit = stop_input.motion_level, stop_input.input_byte, stop_input.input_bit
            watch = io.input_watcher(byte, bit)
            self._input_name = f"stop input {byte}.{bit}"
            self._forbids_motion = lambda: axes.connection.ready and watch() != bool(level)

    @property
    def at_rest(self) -> bool:
        """True while no source is active, no stop pending and no axis moving. Any thread.

        The axes of a source that has ended with a fault are stopped by the device, which an image
        from before does not show.
        """
        if self._connection.ready and not self._shown:
            return False
        if self._axes.stops.pending:
            return False
        operations = self._axes.image.operation.tolist()
        moving = (*BY_DEVICE, Operation.STREAM, Operation.STOPPING)
        return not self._mixer.active and not any(operation in moving for operation in operations)

    def enforce(self, image: ProcessImage) -> None:
        """Check the input, and request the end of all motion while stopped. Control loop."""
        self._axes.stops.look(image)
        if was_active := self._mixer.active:
            self._shown = False
        self._was_active = was_active
        latch = self._axes.stop_latch
        if not latch.reason and (rejection := self._input_rejection):
            latch.engage(rejection)
        if latch.reason:
            self._mixer.end_all(Outcome.STOPPED, f"stopped: {latch.reason}")
        if latch.reason or self._axes.given_up:
            self._stop_moved(image, everything=bool(latch.reason))

    def _stop_moved(self, image: ProcessImage, *, everything: bool) -> None:
        """Stop what the device moves: ``everything``, or after calls that were given up.

        A device may go on with a stream whose source has ended: late setpoints wait in it.
        """
        operations, given_up = image.operation.tolist(), self._axes.given_up.copy()
        ended = range(image.axes) if everything else given_up
        moved = [axis for axis in ended if operations[axis] in BY_DEVICE]
        without_source = given_up if self._mixer.active else ended
        moved += [axis for axis in without_source if operations[axis] == Operation.STREAM]
        if moved:
            self._axes.stops.request(moved)

    def note_image(self, image: ProcessImage) -> None:
        """Note that a new image shows what the end of all sources has left. Control loop."""
        if not self._was_active:
            self._shown = True

    def stop(self, reason: str, timeout_s: float) -> None:
        """Engage the latch and wait for standstill. Raises the errors of ``wait_at_rest``."""
        self._axes.stop_latch.engage(reason)
        self.wait_at_rest(timeout_s)

    def wait_at_rest(self, timeout_s: float) -> None:
        """Wait until all that the latch stops is at rest. Any worker.

        Axes that are not at rest in time, because of a gentle ramp, get a quick stop.

        Raises:
            DeviceTimeout: axes still move after the quick stop; the latch stays engaged.
            NotReady: the device is lost: no values show what moves.
            OperationError: the axes are read-only.
        """
        self._axes.stop_latch.check_commandable()
        connection = self._connection
        if not connection.established:
            return  # nothing has been moved
        self._axes.wait_for_motion()
        # Sources end with a device that is lost, too, and its last values stand still.
        if not wait_until(lambda: self.at_rest or not connection.ready, timeout_s, self._clock):
            self._axes.stop_and_wait(range(len(self._axes)), QUICK_STOP_TIMEOUT_S, quick=True)
        if not connection.ready:
            raise NotReady(
                "motion stays stopped; nothing shows whether the axes are at rest:"
                f" {connection.rejection}"
            )

    def reset(self, timeout_s: float) -> str:
        """Allow motion again; returns the reason that was reset. Any worker. Nothing moves.

        Raises:
            NotReady: the input forbids motion or cannot be read, or motion is stopped again.
            DeviceTimeout: axes still move after ``timeout_s``.
        """
        latch = self._axes.stop_latch
        reason, stops = latch.reason, latch.stops
        if not reason:
            return "motion was not stopped"
        if not wait_until(self._may_reset, timeout_s, self._clock):
            raise DeviceTimeout(f"axes still move after {timeout_s:g} s; motion stays stopped")
        latch.release(stops)
        if still := self._axes.speed.rejection:
            return f"the stop is over; it was: {reason}; {still}"
        return f"motion is allowed again; it was stopped: {reason}"

    def _may_reset(self) -> bool:
        """Return True at standstill. Raises NotReady by the input."""
        if rejection := self._input_rejection:
            raise NotReady(f"{rejection}: release it first")
        return self.at_rest

    @property
    def _input_rejection(self) -> str:
        """Text of an input that forbids motion, or cannot be read; "" where it allows it."""
        try:
            return f"{self._input_name} forbids motion" if self._forbids_motion() else ""
        except RobotdError as error:
            return f"{self._input_name} cannot be read ({error})"
