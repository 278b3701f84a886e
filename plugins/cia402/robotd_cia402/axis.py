"""One axis, composed from its parts, and its work in each control period.

Each part is the only writer of its own fields: ``DriveReport`` (received), ``PowerStage``,
``ModeControl``, ``Setpoint``, ``Activity``, ``ProfileEstimate``, ``OutputValues`` (sent) and
``DriveObjects`` (sent by SDO). Workers give commands (``commands.py``), one at a time for each
axis; the control loop acts on them. Nothing here blocks.
"""

from __future__ import annotations

import math
import threading

from robotd.api import CommandMode, Operation, ProcessImage, Profile, get_logger
from robotd_cia402.activity import Activity
from robotd_cia402.cyclic_objects import CyclicObjects
from robotd_cia402.drive_objects import DriveObjects
from robotd_cia402.drive_report import DriveReport
from robotd_cia402.mode_control import ModeControl
from robotd_cia402.modes import OperationMode, rest_mode
from robotd_cia402.options import DriveOptions
from robotd_cia402.output_values import OutputValues
from robotd_cia402.power_stage import PowerStage
from robotd_cia402.profile_estimate import ProfileEstimate
from robotd_cia402.scaling import Scaling
from robotd_cia402.set_point_handshake import Phase
from robotd_cia402.setpoint import Setpoint
from robotd_cia402.state_machine import Control, DriveState, Status

log = get_logger("cia402")

_GENERIC_ERROR = 0x1000  # of a drive that has no number for its fault
_STATE_ROWS = (
    "offline", "servo_on", "amp_alarm", "alarm_code", "reason", "home_done", "motion_complete",
    "mode", "operation", "negative_limit", "positive_limit", "home_switch",
)  # fmt: skip


class Axis:
    """Axis ``number`` of the robot.

    Attributes:
        options, drive, scaling: its section, the objects of its drive, and the drive's units.
        lock: held by the worker whose command runs.
        report, power, mode, setpoint, activity, estimate, outputs, objects: the parts.
    """

    def __init__(
        self, number: int, options: DriveOptions, drive: CyclicObjects, scaling: Scaling
    ) -> None:
        self.number, self.options, self.drive, self.scaling = number, options, drive, scaling
        self.lock = threading.RLock()
        self.report = DriveReport(drive, scaling)
        self.power = PowerStage()
        self.mode = ModeControl(rest_mode(options, CommandMode.POSITION))
        self.setpoint = Setpoint(options.stop_deceleration_rad_s2)
        self.activity = Activity()
        self.estimate = ProfileEstimate(options.quick_stop_deceleration_rad_s2)
        self.outputs = OutputValues(drive, scaling)
        self.objects = DriveObjects(drive)
        self._shown: tuple[object, ...] = ()  # state that the image has

    @property
    def streaming(self) -> bool:
        """Setpoints come from ``AxisDriver.stream``."""
        return self.activity.streaming

    def transmit(self, period_s: float, periods: int = 1) -> None:
        """Control loop: put the outputs of the next cyclic frame.

        ``periods`` have passed since the frame before; the drive's own profiles have advanced.
        """
        self.estimate.advance(periods * period_s)
        self._advance(period_s)
        word = self.power.control | self.mode.bits
        interpolated = self.mode.requested is OperationMode.INTERPOLATED_POSITION
        if interpolated and self.report.powered:
            word |= Control.ENABLE_INTERPOLATION
        self.outputs.put(word, self.mode, self.setpoint)

    def observe(self, image: ProcessImage) -> None:
        """Control loop: act on the drive's report, and write this axis' part of ``image``."""
        report = self.report
        report.update()
        if report.known:
            self._watch_power()
            self._watch_operation()
        elif not self.activity.is_idle:
            self.hold()
        self._fill(image)

    def follow(self, position: float, velocity: float) -> None:
        """Control loop: a streamed setpoint; the position does not count in a velocity mode."""
        if not self.mode.is_torque:
            self.setpoint.follow(position, velocity, by_velocity=self.mode.is_velocity)

    def follow_torque(self, torque: float) -> None:
        """Control loop: a streamed torque, N·m or N; NaN: unchanged."""
        if self.mode.is_torque and math.isfinite(torque):
            self.setpoint.torque = torque

    def begin_move(self, target: float, profile: Profile) -> None:
        """Worker: a profile position move; the control loop hands ``target`` over to the drive."""
        self.setpoint.deceleration = profile.deceleration
        self.setpoint.target_counts = self.scaling.counts(target)
        if self.mode.requested is not OperationMode.PROFILE_POSITION:
            self.estimate.rest(self.setpoint.position)
        self.estimate.plan(target, profile)
        self.mode.begin_target()
        self.activity.begin(Operation.POSITION)

    def brake(self, deceleration: float) -> None:
        """Stop the running operation as its mode requires; no effect when idle. Any thread."""
        if self.activity.operation in (Operation.IDLE, Operation.STOPPING):
            return
        self.setpoint.deceleration = deceleration
        self.setpoint.target_velocity = 0.0
        self.activity.begin_stop()
        self.estimate.stop(deceleration)
        if self.mode.requested is OperationMode.PROFILE_POSITION:
            self.mode.cancel_target()
        elif self.mode.requested is OperationMode.HOMING or self.mode.is_torque:
            self.power.quick_stop()

    def hold(self) -> None:
        """Idle from now on, at the present command."""
        self.activity.end()
        self.setpoint.velocity = 0.0

    def present_position(self) -> float:
        """Return the position at which a position command begins.

        That is the drive's own command, and the measured position after a torque.
        """
        return self.report.position if self.mode.is_torque else self.report.demand()

    def resume(self) -> None:
        """Control loop: the drive answers again; continue at its own command."""
        self.setpoint.stand_at(self.report.demand())
        self.hold()

    def forget(self) -> None:
        """Worker: forget the state of a drive that has been configured again; it is off."""
        self.report.forget()
        self.power.reset()
        self.mode.clear_bits()
        self.objects.forget()
        self.activity.home_done = False
        self.hold()

    def _advance(self, period_s: float) -> None:
        """Compute the setpoint of the next frame, unless it is streamed."""
        operation, setpoint = self.activity.operation, self.setpoint
        if operation is Operation.POSITION:
            self._advance_target(period_s)
            operation = self.activity.operation
        if operation is Operation.IDLE:
            self.estimate.rest(setpoint.position)
        if not self.report.powered:
            setpoint.stand_at(self.report.position)
        elif self.mode.is_cyclic_position and operation is Operation.STOPPING:
            setpoint.brake(period_s)
        elif self.mode.requested is OperationMode.CYCLIC_VELOCITY and not self.streaming:
            setpoint.ramp(period_s)

    def _advance_target(self, period_s: float) -> None:
        """Run the handshake of a move; the estimate begins when the set-point bit is sent."""
        phase = self.mode.advance_target(self.report, period_s)
        if phase is Phase.ASKING:
            self.estimate.begin_planned()
        elif phase is Phase.FAILED:
            log.error("the drive does not take the target", node=self.drive.name, axis=self.number)
            self.hold()

    def _watch_power(self) -> None:
        if self.power.watch(self.report):
            self.mode.clear_bits()
        if not self.report.powered and not self.activity.is_idle:
            self.hold()
            self.activity.complete = False

    def _watch_operation(self) -> None:
        match self.activity.operation:
            case Operation.POSITION if self._is_reached():
                self.setpoint.position = self.setpoint.target_counts * self.scaling.position
                self.activity.complete = True
                self.hold()
            case Operation.VELOCITY if self.setpoint.target_velocity == 0 and self._is_at_rest():
                self.hold()
            case Operation.STOPPING if self._is_at_rest():
                if not self.mode.is_cyclic_position:
                    self.setpoint.position = self.present_position()
                self.hold()
            case _:
                pass

    def _is_reached(self) -> bool:
        return self.mode.target_taken and bool(self.report.statusword & Status.TARGET_REACHED)

    def _is_at_rest(self) -> bool:
        """Return True for an axis whose command is 0 and whose motor is at rest."""
        enabled = self.report.state is DriveState.OPERATION_ENABLED
        commanded = self.mode.is_ours and self.setpoint.velocity != 0.0 and enabled
        return self.activity.is_at_rest(self.report.velocity, commanded=commanded)

    def _fill(self, image: ProcessImage) -> None:
        if self.report.known:
            self._fill_values(image)
        state = self._state()
        if state != self._shown or image.offline[self.number]:  # offline: also a forgotten image
            self._shown = state
            for row, value in zip(_STATE_ROWS, state, strict=True):
                getattr(image, row)[self.number] = value

    def _state(self) -> tuple[object, ...]:
        """Return the values of ``_STATE_ROWS``; they change rarely, and writing them is slow."""
        report, activity = self.report, self.activity
        alarm = report.in_alarm
        code = (report.error_code or _GENERIC_ERROR) if alarm else 0
        servo = not report.known, report.powered, alarm, code, self._reason()
        motion = activity.home_done, activity.complete, self.mode.command_mode, activity.operation
        return servo + motion + report.switches

    def _fill_values(self, image: ProcessImage) -> None:
        """Write the measured values, and the command: ours, the estimated or the measured one."""
        mode, setpoint, report, number = self.mode, self.setpoint, self.report, self.number
        image.position[number] = report.position
        image.velocity[number] = report.velocity
        image.torque[number] = report.torque
        own = mode.is_cyclic_position or self.activity.is_idle
        position = setpoint.position if own else self.estimate.position
        homing = mode.requested is OperationMode.HOMING
        if not report.powered or mode.is_velocity or mode.is_torque or homing:
            position = report.position
        image.position_command[number] = position
        velocity = setpoint.velocity if mode.is_ours else self.estimate.velocity
        if mode.is_torque:
            velocity = report.velocity
        image.velocity_command[number] = velocity

    def _reason(self) -> str:
        """Return why the axis cannot move, beginning with the node; "" if it can."""
        name, report = self.drive.name, self.report
        if not report.known:
            return f"{name}: {self.drive.fault or 'its PDOs have not come yet'}"
        if report.in_alarm:
            return f"{name}: {report.alarm_text}"
        return f"{name}: {self.power.lost}" if self.power.lost else ""
