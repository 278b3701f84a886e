"""Servos of a robot: on at the start, off after a controlled stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

from robotd.control.groups.joint_group import JointGroups
from robotd.control.groups.mobile_base import MobileBase
from robotd.control.groups.problem_finder import limit_problems
from robotd.control.loop.motion_stop import QUICK_STOP_TIMEOUT_S
from robotd.descriptor import RobotDescriptor
from robotd.device.axes import Axes, each
from robotd.device.process_image import ProcessImage
from robotd.device.state import COMMUNICATES, CommandMode, Operation
from robotd.errors import ConnectError, RobotdError, reason_of
from robotd.log import get_logger

log = get_logger("robot")


class Servos:
    """Switches servos on, and off after a controlled stop. Any worker.

    Args:
        base: the wheels; None: the robot has none.
        confirmed_off: ``AxisDriver.confirmed_off``.

    Attributes:
        used: axes of joints and wheels.
        read_only: ``AxisDriver.read_only``.
    """

    def __init__(
        self,
        descriptor: RobotDescriptor,
        axes: Axes,
        groups: JointGroups,
        base: MobileBase | None,
        confirmed_off: Callable[[], Sequence[bool] | None],
    ) -> None:
        self._descriptor, self._connection, self._axes = descriptor, axes.connection, axes
        self._groups, self._base, self._confirmed_off = groups, base, confirmed_off
        self._on = [False] * len(axes)  # as each drive has reported last
        self.read_only = axes.stop_latch.read_only
        wheels = descriptor.drive.axes if descriptor.drive else ()
        self.used = (*(joint.axis for joint in descriptor.joints), *wheels)

    def note_image(self, image: ProcessImage) -> None:
        """Control loop: keep what each drive reports, for the time after it is lost."""
        reported = zip(image.servo_on.tolist(), image.offline.tolist(), strict=True)
        for axis, (is_on, is_offline) in enumerate(reported):
            if not is_offline:
                self._on[axis] = is_on

    def enable(self) -> None:
        """Clear alarm, then servo on, axis by axis, as at start-up.

        Wheels are put into velocity mode before. Read-only axes stay as they are.
        """
        if self.read_only:
            log.info("axes are read-only", reason=self.read_only)
            return
        with self._connection.step.running("switching the servos on"):
            results = each(self.used, self.enable_axis)
        failures = {
            f"{self._descriptor.name} → {self._axes.names[axis]}": reason_of(error)
            for axis, error in results.items()
            if error is not None
        }
        if failures:
            raise ConnectError("joints could not be enabled", failures)
        if results:
            log.info("servos on", axes=len(results))
        for problem in limit_problems(self._axes):
            log.warning("a joint is outside its limits", problem=problem.text)

    def enable_axis(self, axis: int) -> None:
        """Clear the alarm of ``axis`` and switch its servo on; a wheel in velocity mode."""
        self._axes.clear_alarm(axis)
        drive = self._descriptor.drive
        rolls = drive is not None and axis in drive.axes and axis not in drive.steering_axes
        if rolls and self._axes.image.mode[axis] != CommandMode.VELOCITY:
            self._axes.set_command_mode(axis, CommandMode.VELOCITY)
        self._axes.servo(axis, True)

    def bring_to_rest(self) -> None:
        """Stop all that moves, in a controlled way; failures are logged.

        Axes that are not at rest in time, because of a gentle ramp, get a quick stop. Afterwards
        motion is accepted again.
        """
        self._bring_to_rest()
        if self._base is not None:
            self._base.allow()

    def _bring_to_rest(self) -> None:
        """Bring all to rest; the base rejects commands until it is allowed again."""
        everything, time_s = range(len(self._axes)), self._descriptor.engine.shutdown_s
        try:
            self._groups.stop(time_s)
            if self._base is not None:
                self._base.stop(time_s)
            self._axes.stop_and_wait(everything, time_s)
            log.info("at rest")
        except RobotdError as error:
            log.error("controlled stop failed", reason=str(error))
            with suppress(RobotdError):  # a device that cannot be reached, again
                self._axes.stop_and_wait(everything, QUICK_STOP_TIMEOUT_S, quick=True)

    def disable(self) -> None:
        """Bring what moves to rest, then switch the servos off; failures are logged.

        Also while values are stale. No effect while the device does not communicate, and on
        read-only axes.
        """
        if self.read_only or self._connection.state not in COMMUNICATES:
            return
        self._bring_to_rest()
        shown, image = self._axes.wait_for_servos(), self._axes.image
        # Another worker, or a stop that catches a joint, may be switching on what is shown off.
        off = image.offline & ~image.servo_on & (image.operation == Operation.IDLE)
        reached = [axis for axis in range(len(self._axes)) if not (shown and off[axis])]
        for axis, failure in self._axes.servos_off(reached).items():
            if failure is not None:
                log.error(
                    "servo off failed", axis=self._axes.names[axis], reason=reason_of(failure)
                )
            else:
                self._on[axis] = False
        log.info("servos off", axes=len(reached))
        if self._base is not None:  # without its servos it cannot move
            self._base.allow()

    def unconfirmed(self) -> list[str]:
        """Return the names of axes whose drive has not confirmed to be off; log what is known.

        After communication has ended. Empty for read-only axes.
        """
        if self.read_only:
            return []
        off: Sequence[bool] | None = None
        with suppress(RobotdError):  # of a driver that hangs
            off = self._confirmed_off()
        on = self._on if off is None else [not is_off for is_off in off]
        names = [name for name, is_on in zip(self._axes.names, on, strict=True) if is_on]
        if names:
            text = "servos are not confirmed to be off: cut their power"
            log.error(text, axes=", ".join(names), confirmed=len(on) - len(names))
        else:
            log.info("all servos are off, as the drives have confirmed", axes=len(on))
        return names
