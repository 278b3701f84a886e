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
from robotd_cia402.drive_report import DriveReport, switches
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
_ENABLE_INTERPOLATION = int(Control.ENABLE_INTERPOLATION)
_WATCHED = (Operation.POSITION, Operation.VELOCITY, Operation.STOPPING)  # end by the report


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

    def transmit(self, period_s: float, periods: int = 1) -> None:
        """Control loop: put the outputs of the next cyclic frame.

        ``periods`` have passed since the frame before; the drive's own profiles have advanced.
        """
        powered = self.report.powered
        if not (powered and self.activity.streaming):
            self.estimate.advance(periods * period_s)
            self._advance(period_s)
        mode = self.mode.requested
        word = self.power.control | self.mode.bits
        if mode is OperationMode.INTERPOLATED_POSITION and powered:
            word |= _ENABLE_INTERPOLATION
        self.outputs.put(word, mode, self.report.displayed_mode, self.setpoint)
        self.setpoint.waits = False

    def observe(self, image: ProcessImage) -> None:
        """Control loop: act on the drive's report, and write this axis' part of ``image``."""
        report, activity = self.report, self.activity
        report.update()
        if not report.known:
            if not activity.is_idle:
                self.hold()
        else:
            if not report.powered:
                self._watch_power()
            if activity.operation in _WATCHED:
                self._watch_operation()
            self._fill_values(image)
        self._fill_state(image)

    def follow(self, position: float, velocity: float) -> None:
        """Control loop: a streamed setpoint; the position does not count in a velocity mode."""
        mode = self.mode.requested
        if not mode.is_torque:
            self.setpoint.follow(position, velocity, by_velocity=mode.is_velocity)

    def follow_torque(self, torque: float) -> None:
        """Control loop: a streamed torque, N·m or N; NaN: unchanged."""
        if self.mode.requested.is_torque and math.isfinite(torque):
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
        """Stop the running operation as its mode requires. Any thread.

        A command that is being started begins no motion then.
        """
        self.activity.stops += 1
        if self.activity.operation in (Operation.IDLE, Operation.STOPPING):
            return
        self.setpoint.deceleration = deceleration
        self.setpoint.target_velocity = 0.0
        self.activity.begin_stop()
        self.estimate.stop(deceleration)
        if self.mode.requested is OperationMode.PROFILE_POSITION:
            self.mode.cancel_target()
        elif self.mode.requested in (OperationMode.HOMING, OperationMode.CYCLIC_TORQUE):
            self.power.quick_stop()

    def hold(self) -> None:
        """Idle from now on, at the present command."""
        self.activity.end()
        self.setpoint.velocity = 0.0

    def present_position(self) -> float:
        """Return the position at which a position command begins.

        That is the drive's own command, and the measured position after a torque.
        """
        torque = self.mode.requested.is_torque
        return self.report.position if torque else self.report.demand()

    def resume(self) -> None:
        """Control loop: the drive answers again; continue at its own command."""
        self.report.update()
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
        elif self.mode.requested.is_cyclic_position and operation is Operation.STOPPING:
            if not setpoint.waits:  # the path goes to it; the stop begins there
                setpoint.brake(period_s)
        elif self.mode.requested is OperationMode.CYCLIC_VELOCITY and not self.activity.streaming:
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
        """Take note of a power stage that is off."""
        if self.power.watch(self.report):
            self.mode.clear_bits()
        if not self.activity.is_idle:
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
                if not self.mode.requested.is_cyclic_position:
                    self.setpoint.position = self.present_position()
                self.hold()
            case _:
                pass

    def _is_reached(self) -> bool:
        return self.mode.target_taken and bool(self.report.statusword & Status.TARGET_REACHED)

    def _is_at_rest(self) -> bool:
        """Return True for an axis whose command is 0 and whose motor is at rest."""
        enabled = self.report.state is DriveState.OPERATION_ENABLED
        commanded = self.mode.requested.is_ours and self.setpoint.velocity != 0.0 and enabled
        return self.activity.is_at_rest(self.report.velocity, commanded=commanded)

    def _fill_values(self, image: ProcessImage) -> None:
        """Write the measured values, and the command: ours, the estimated or the measured one."""
        report, number = self.report, self.number
        image.position[number] = report.position
        image.velocity[number] = report.velocity
        image.torque[number] = report.torque
        position, velocity = self._command()
        image.position_command[number] = position
        image.velocity_command[number] = velocity

    def _command(self) -> tuple[float, float]:
        """Return position and velocity of the present command."""
        mode, setpoint, report = self.mode.requested, self.setpoint, self.report
        if mode.is_cyclic_position:
            position = setpoint.position if report.powered else report.position
            return position, setpoint.velocity
        if mode.is_torque:
            return report.position, report.velocity
        velocity = setpoint.velocity if mode.is_ours else self.estimate.velocity
        if not report.powered or mode.is_velocity or mode is OperationMode.HOMING:
            return report.position, velocity
        idle = self.activity.is_idle
        return setpoint.position if idle else self.estimate.position, velocity

    def _fill_state(self, image: ProcessImage) -> None:
        """Write the state if it has changed; that is rare, and writing is slow.

        Alarm codes and texts are not compared: while there may be one, it is written each time. An
        image whose axis is offline may have been cleared.
        """
        report, activity, number = self.report, self.activity, self.number
        state = (
            report.known, report.powered, report.in_alarm, report.digital_inputs,
            self.scaling.polarity, activity.operation, activity.complete, activity.home_done,
            self.mode.command_mode, self.power.lost,
        )  # fmt: skip
        if state == self._shown and not report.in_alarm and not image.offline[number]:
            return
        self._shown = state
        known, powered, alarm, inputs, polarity, operation, complete, home_done, mode, lost = state
        image.offline[number], image.servo_on[number] = not known, powered
        image.amp_alarm[number] = alarm
        image.alarm_code[number] = (report.error_code or _GENERIC_ERROR) if alarm else 0
        image.reason[number] = self._reason(lost)
        image.operation[number], image.motion_complete[number] = operation, complete
        image.home_done[number], image.mode[number] = home_done, mode
        negative, positive, home = switches(inputs, polarity)
        image.negative_limit[number], image.positive_limit[number] = negative, positive
        image.home_switch[number] = home

    def _reason(self, lost: str) -> str:
        """Return why the axis cannot move, beginning with the node; "" if it can.

        ``lost``: as ``PowerStage.lost``.
        """
        name, report = self.drive.name, self.report
        if not report.known:
            return f"{name}: {self.drive.fault or self.drive.awaited}"
        if report.in_alarm:
            return f"{name}: {report.alarm_text}"
        return f"{name}: {lost}" if lost else ""
