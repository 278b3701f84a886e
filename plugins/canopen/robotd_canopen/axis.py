"""One axis, composed from its parts, and its work in each control period.

Each part is the only writer of its own fields: ``DriveReport`` (received), ``PowerStage``,
``ModeControl``, ``Setpoint``, ``Activity``, ``ProfileEstimate``, ``RpdoWriter`` (sent) and
``DriveObjects`` (sent by SDO). Workers give commands (``commands.py``), one at a time for each
axis; the control loop acts on them. Nothing here blocks.
"""

from __future__ import annotations

import threading

from robotd.api import CommandMode, Operation, ProcessImage, Profile, get_logger
from robotd_canopen.activity import Activity
from robotd_canopen.bus import Bus
from robotd_canopen.drive_objects import DriveObjects
from robotd_canopen.drive_report import DriveReport
from robotd_canopen.feedback import Feedback
from robotd_canopen.layout import AxisLayout
from robotd_canopen.mode_control import ModeControl
from robotd_canopen.modes import OperationMode, rest_mode
from robotd_canopen.node import Node
from robotd_canopen.power_stage import PowerStage
from robotd_canopen.profile_estimate import ProfileEstimate
from robotd_canopen.rpdo_writer import RpdoWriter
from robotd_canopen.scaling import Scaling
from robotd_canopen.set_point_handshake import Phase
from robotd_canopen.setpoint import Setpoint
from robotd_canopen.state_machine import Control, DriveState, Status

log = get_logger("canopen")

_GENERIC_ERROR = 0x1000  # of a drive that has no number for its fault


class Axis:
    """Axis ``number`` of the robot.

    Attributes:
        layout, node, scaling: options and PDOs, the drive's node, and its units.
        lock: held by the worker whose command runs.
        report, power, mode, setpoint, activity, estimate, rpdos, objects: the parts.
    """

    def __init__(
        self, number: int, layout: AxisLayout, node: Node, feedback: Feedback, scaling: Scaling
    ) -> None:
        options = layout.options
        self.number, self.layout, self.node, self.scaling = number, layout, node, scaling
        self.lock = threading.RLock()
        self.report = DriveReport(number, layout, node, feedback, scaling)
        self.power = PowerStage()
        self.mode = ModeControl(rest_mode(options, CommandMode.POSITION))
        self.setpoint = Setpoint(options.stop_deceleration_rad_s2)
        self.activity = Activity()
        self.estimate = ProfileEstimate(options.quick_stop_deceleration_rad_s2)
        self.rpdos = RpdoWriter(layout, scaling)
        self.objects = DriveObjects(layout, node.sdo)

    @property
    def streaming(self) -> bool:
        """Setpoints come from ``AxisDriver.stream``."""
        return self.activity.streaming

    def transmit(self, bus: Bus, period_s: float, periods: int = 1) -> None:
        """Control loop: this SYNC's RPDOs, to take effect with the next SYNC.

        ``periods`` have passed since the SYNC before; the drive's own profiles have advanced.
        """
        self.estimate.advance(periods * period_s)
        self._advance(period_s)
        word = self.power.control | self.mode.bits
        interpolated = self.mode.requested is OperationMode.INTERPOLATED_POSITION
        if interpolated and self.report.powered:
            word |= Control.ENABLE_INTERPOLATION
        self.rpdos.send(bus, word, self.mode, self.setpoint)

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
        self.setpoint.follow(position, velocity, by_velocity=self.mode.is_velocity)

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
        elif self.mode.requested is OperationMode.HOMING:
            self.power.command(Control.QUICK_STOP)

    def hold(self) -> None:
        """Idle from now on, at the present command."""
        self.activity.end()
        self.setpoint.velocity = 0.0

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
        """Compute the setpoint of the next SYNC, unless it is streamed."""
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
            log.error("the drive does not take the target", node=self.node.name)
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
                    self.setpoint.position = self.report.demand()
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
        number, report, activity = self.number, self.report, self.activity
        alarm = report.in_alarm
        image.offline[number] = not report.known
        image.servo_on[number] = report.powered
        image.amp_alarm[number] = alarm
        image.alarm_code[number] = (report.error_code or _GENERIC_ERROR) if alarm else 0
        image.reason[number] = self._reason()
        image.home_done[number] = activity.home_done
        image.motion_complete[number] = activity.complete
        image.mode[number] = self.mode.command_mode
        image.operation[number] = activity.operation
        negative, positive, home = report.switches
        image.negative_limit[number], image.positive_limit[number] = negative, positive
        image.home_switch[number] = home
        if report.known:
            self._fill_command(image)

    def _fill_command(self, image: ProcessImage) -> None:
        """Write the position and velocity command: ours, the estimated or the measured one."""
        mode, setpoint = self.mode, self.setpoint
        own = mode.is_cyclic_position or self.activity.is_idle
        position = setpoint.position if own else self.estimate.position
        homing = mode.requested is OperationMode.HOMING
        if not self.report.powered or mode.is_velocity or homing:
            position = self.report.position
        image.position_command[self.number] = position
        velocity = setpoint.velocity if mode.is_ours else self.estimate.velocity
        image.velocity_command[self.number] = velocity

    def _reason(self) -> str:
        """Return why the axis cannot move, beginning with the node; "" if it can."""
        node = self.node
        if not self.report.known:
            return f"node {node.id}: {node.fault or 'its PDOs have not come yet'}"
        if self.report.in_alarm:
            return f"node {node.id}: {node.alarm_text(self.report.error_code)}"
        return f"node {node.id}: {self.power.lost}" if self.power.lost else ""
