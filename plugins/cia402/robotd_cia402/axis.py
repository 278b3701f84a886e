"""One axis, composed from its parts, and its work in each control period.

Each part is the only writer of its own fields: ``DriveReport`` (received), ``PowerStage`` and
``ModeControl`` (controlword), ``Activity``, ``Setpoint`` and ``ProfileEstimate`` (commanded
motion). Workers give commands (``commands.py``), one at a time for each axis; the control loop acts
on them. Nothing here blocks.
"""

from __future__ import annotations

import math
import threading
from typing import Generic, TypeVar

from robotd.api import CommandMode, Operation, ProcessImage, Profile, get_logger
from robotd_cia402.controlword import (
    Control,
    DriveState,
    ModeControl,
    Phase,
    PowerStage,
    StatusBits,
)
from robotd_cia402.drive_access import DriveAccess, DriveReport
from robotd_cia402.modes import OperationMode, rest_mode
from robotd_cia402.motion import Activity, HoldingBrake, ProfileEstimate, Setpoint, towards
from robotd_cia402.object_numbers import DEMAND
from robotd_cia402.options import DriveOptions
from robotd_cia402.scaling import Scaling, wrapped
from robotd_cia402.silent_drive import Acknowledgement, takes_away

log = get_logger("cia402")

DriveT = TypeVar("DriveT", bound=DriveAccess)

_GENERIC_ERROR = 0x1000  # of a drive that has no number for its fault
_ENABLE_INTERPOLATION = int(Control.ENABLE_INTERPOLATION)
_WATCHED = (Operation.POSITION, Operation.VELOCITY, Operation.STOPPING)  # end by the report
_NOTHING_SENT = -1
_REST_VELOCITY = 0.01  # rad/s or m/s, of a drive that keeps a setpoint
_RETURN_TIMEOUT_S = 1.0  # for the change to a position mode in a quick stop
_MAX_FOLLOWING_ERROR = 0.1  # rad or m; a drive that is further away has not kept it


class Axis(Generic[DriveT]):
    """Axis ``options.axis`` of the robot.

    Attributes:
        options, drive, scaling: its section, the objects of its drive, and the drive's units.
        lock: held by the worker whose command runs.
        report, power, mode, setpoint, activity, estimate, holding_brake: the parts.
        acknowledgement: of the setpoints, by the drive.
        controlword: of the last frame; -1 before the first.
    """

    def __init__(self, options: DriveOptions, drive: DriveT, scaling: Scaling) -> None:
        self.number, self.options, self.drive, self.scaling = options.axis, options, drive, scaling
        self.lock = threading.RLock()
        self.report = DriveReport(drive, scaling)
        self.power = PowerStage()
        self.mode = ModeControl(rest_mode(options, CommandMode.POSITION))
        self.setpoint = Setpoint(options.stop_deceleration_rad_s2)
        self.activity = Activity()
        self.holding_brake = HoldingBrake(options.brake_release_s)
        self.estimate = ProfileEstimate(options.quick_stop_deceleration_rad_s2)
        self.acknowledgement = Acknowledgement(drive.latency, drive.settling)
        self.controlword = _NOTHING_SENT
        self._sent: tuple[int, ...] = ()  # outputs of the last frame
        self._velocity = 0.0  # as sent
        self._catches_up = False  # it follows the setpoint by a ramp
        self._returning_s = 0.0  # of a drive at rest, to its position mode after hand guiding
        self._shown: tuple[object, ...] = ()  # state that the image has

    def transmit(self, period_s: float, periods: int = 1) -> None:
        """Control loop: put the outputs of the next cyclic frame.

        A drive that does not answer gets no new setpoint, and of the controlword only what takes
        away energy or motion. ``periods`` have passed since the frame before; the drive's own
        profiles have advanced.
        """
        setpoint, scaling = self.setpoint, self.scaling
        withheld = self._withholds(period_s)
        powered = self.report.powered or not self.report.known
        if not (powered and self.activity.streaming):
            self.estimate.advance(periods * period_s)
            if not withheld or self.mode.requested.is_velocity:
                self._advance(period_s)
        mode = self.mode.requested
        in_mode = self.report.displayed_mode == mode
        word = self.power.control | self.mode.bits
        # A drive takes some frames to change its mode. In its homing mode, the bit starts a homing.
        if mode is OperationMode.INTERPOLATED_POSITION and powered and in_mode:
            word |= _ENABLE_INTERPOLATION
        position = setpoint.position
        counts = wrapped(scaling.counts(position)) if math.isfinite(position) else 0
        target, velocity, torque = counts, 0, 0
        if mode is OperationMode.PROFILE_POSITION:
            if in_mode:  # else it may still follow the target position as a cyclic setpoint
                target = wrapped(setpoint.target_counts)
        elif mode is OperationMode.CYCLIC_VELOCITY:
            velocity = scaling.velocity_units(self._next_velocity(period_s, withheld=withheld))
        elif mode is OperationMode.PROFILE_VELOCITY:
            velocity = scaling.velocity_units(setpoint.target_velocity)
        elif mode.is_torque:
            torque = scaling.torque_units(setpoint.torque)
        outputs = word, mode, target, velocity, torque, counts
        if withheld:
            self._put_withheld(*outputs)
        else:
            self.acknowledgement.note(position)
            self._put(outputs)

    def observe(self, image: ProcessImage) -> None:
        """Control loop: act on the drive's report, and write this axis' part of ``image``."""
        report, activity, was_known = self.report, self.activity, self.report.known
        report.update()
        if not report.known:
            if was_known:
                self._lose()
            self.mode.forget()
            self.hold()
        else:
            self._rejoin()
            self.holding_brake.watch(report.period_s, powered=report.powered)
            if not report.powered:
                self._note_off()
            elif report.state is DriveState.QUICK_STOP_ACTIVE:
                self._join_quick_stop()
            if report.powered:
                self._watch_mode()
            if activity.operation in _WATCHED:
                self._watch_operation()
            self._fill_values(image)
        self._fill_state(image)
        image.silent[self.number] = report.known and self.acknowledgement.withholds

    def follow(self, position: float, velocity: float) -> None:
        """Control loop: a streamed setpoint; the position does not count in a velocity mode."""
        mode, setpoint = self.mode.requested, self.setpoint
        if mode.is_torque:
            return
        setpoint.velocity, setpoint.waits = velocity, True
        if mode.is_velocity:
            setpoint.target_velocity = velocity
        else:
            setpoint.position = position

    def follow_torque(self, torque: float) -> None:
        """Control loop: a streamed torque, N·m or N; NaN: unchanged."""
        if self.mode.requested.is_torque and math.isfinite(torque):
            self.setpoint.torque = torque

    def carry(self, torque: float) -> None:
        """Control loop: the torque of a guided axis, N·m or N; its command is where it is."""
        self.setpoint.torque = torque
        self.setpoint.position = self.report.position

    def begin_move(self, target: float, profile: Profile) -> None:
        """Worker: a profile position move; the control loop hands ``target`` over to the drive."""
        self.setpoint.deceleration = profile.deceleration
        self.setpoint.target_counts = self.scaling.counts(target)
        if self.mode.requested is not OperationMode.PROFILE_POSITION:
            self.estimate.rest(self.setpoint.position)
        self.estimate.planned = target, profile
        self.mode.begin_target()
        self.activity.begin(Operation.POSITION)

    def brake(self, deceleration: float) -> None:
        """Stop the running operation as its mode requires. Any thread.

        A command that is being started begins no motion then. Of two stops the harder one counts.
        """
        self.activity.stops += 1
        stopping = self.activity.operation is Operation.STOPPING
        if self.activity.is_idle or (stopping and deceleration <= self.setpoint.deceleration):
            return
        self.setpoint.deceleration = deceleration
        self.setpoint.target_velocity = 0.0
        self.activity.begin_stop()
        self._returning_s = 0.0
        self.estimate.stop(deceleration)
        if self.mode.requested is OperationMode.PROFILE_POSITION:
            self.mode.cancel_target()
        elif self.mode.requested in (OperationMode.HOMING, OperationMode.CYCLIC_TORQUE):
            self.power.quick_stop()

    def hold(self) -> None:
        """Idle from now on, at the present command."""
        self.activity.begin(Operation.IDLE)
        self.setpoint.velocity = self.setpoint.target_velocity = 0.0

    def present_position(self) -> float:
        """Return the position at which a position command begins.

        That is the drive's own command, and the measured position after a velocity or a torque:
        without its position controller a drive need not keep its position command.
        """
        mode = self.mode.requested
        measured = mode.is_velocity or mode.is_torque
        return self.report.position if measured else self.report.demand()

    def resume(self) -> None:
        """Control loop: the drive answers again; continue where it is.

        In a torque mode it keeps its torque, which may carry a weight until its quick stop begins.
        """
        torque = self.setpoint.torque if self.mode.requested.is_torque else 0.0
        self.report.update()
        if self._is_held_by_setpoint:
            self.setpoint.stand_at(self._executed_setpoint())
        else:
            self.setpoint.stand_at(self.present_position())
        self.setpoint.torque = torque
        self.hold()

    def forget(self) -> None:
        """Worker: forget the state of a drive that has been configured again; it is off."""
        self.drive.forget()
        self.drive.forget_written()
        self.power.reset()
        self.mode.bits = 0
        self.mode.forget()
        self.acknowledgement.forget()
        self.activity.home_done = False
        self.hold()

    def _put(self, outputs: tuple[int, ...]) -> None:
        self._sent = outputs
        self.drive.put(outputs)
        self.controlword = outputs[0]
        self.setpoint.waits = False

    def _put_withheld(
        self, word: int, mode: OperationMode, target: int, velocity: int, _: int, counts: int
    ) -> None:
        """Put what a drive that does not answer may get, if there is anything.

        That is less energy or speed, or the setpoint before those that have not reached it.
        """
        _, mode_before, target_before, velocity_before, torque, _ = self._sent
        slower = mode.is_velocity and abs(velocity) < abs(velocity_before)
        back = mode.is_cyclic_position and self.drive.unreached and target != target_before
        if slower or back or takes_away(word, self.controlword):
            target = target if back else target_before
            velocity = velocity if slower else velocity_before
            self._put((word, mode_before, target, velocity, torque, counts))

    @property
    def _is_held_by_setpoint(self) -> bool:
        """The drive keeps the last position that it was sent."""
        enabled = self.report.state is DriveState.OPERATION_ENABLED
        return enabled and self.mode.requested.is_cyclic_position

    def _withholds(self, period_s: float) -> bool:
        """Decide whether the next setpoint is withheld; a position stays at the last one then."""
        acknowledgement, setpoint = self.acknowledgement, self.setpoint
        if self.report.known:  # else it is lost, or not known yet
            way = self.scaling.velocity_limit * period_s
            drive = self.drive
            acknowledgement.check(
                drive.missed,
                setpoint.position,
                way,
                unreached=drive.unreached,
                blocked=drive.blocked,
            )
        if not acknowledgement.withholds:
            return False
        if self.mode.requested.is_cyclic_position:
            setpoint.position, setpoint.velocity = acknowledgement.command(None), 0.0
        self._catches_up = True
        return True

    def _rejoin(self) -> None:
        """Continue where the drive is, which answers again; the next frame has that setpoint."""
        if self.acknowledgement.withholds and not self.drive.missed and self._is_held_by_setpoint:
            self.setpoint.position, self.setpoint.velocity = self._executed_setpoint(), 0.0

    def _executed_setpoint(self) -> float:
        """Return the last setpoint that the drive has executed."""
        acknowledgement, report = self.acknowledgement, self.report
        if DEMAND in self.drive.inputs:
            return report.demand()
        if not acknowledgement.withholds:
            return self.setpoint.position
        at_rest = abs(report.velocity) < _REST_VELOCITY
        setpoint = acknowledgement.command(report.position if at_rest else None)
        elsewhere = abs(report.position - setpoint) > _MAX_FOLLOWING_ERROR
        return report.position if elsewhere else setpoint

    def _lose(self) -> None:
        """Stop a lost drive by its quick stop: its place and its setpoint are not known."""
        self.acknowledgement.lose()
        if not self.activity.is_idle or self.mode.requested.is_torque:
            self.power.quick_stop()

    def _next_velocity(self, period_s: float, *, withheld: bool) -> float:
        """Return the velocity to send: after a silence by a ramp from the last one.

        While an answer is missing it becomes lower only: a drive that has not got the steps of a
        ramp would make all of them in one.
        """
        velocity = self.setpoint.velocity
        if self.drive.missed and self.report.known:
            withheld = self._catches_up = True
        if self._catches_up and not withheld:
            step = self.options.stop_deceleration_rad_s2 * period_s
            self._velocity = towards(self._velocity, velocity, step)
            self._catches_up = self._velocity != velocity
        elif not withheld or abs(velocity) < abs(self._velocity):
            self._velocity = velocity
        return self._velocity

    def _advance(self, period_s: float) -> None:
        """Compute the setpoint of the next frame, unless it is streamed."""
        operation, setpoint = self.activity.operation, self.setpoint
        if operation is Operation.POSITION:
            self._advance_target(period_s)
            operation = self.activity.operation
        if operation is Operation.IDLE:
            self.estimate.rest(setpoint.position)
        if self.report.known and not self.report.powered:
            setpoint.stand_at(self.report.position)
        elif self.mode.requested.is_cyclic_position and operation is Operation.STOPPING:
            if not setpoint.waits:  # the path goes to it; the stop begins there
                setpoint.brake(period_s)
        elif self.mode.requested is OperationMode.CYCLIC_VELOCITY and not self.activity.streaming:
            setpoint.ramp(period_s)

    def _advance_target(self, period_s: float) -> None:
        """Run the handshake of a move; the estimate begins when the set-point bit is sent."""
        mode, report = self.mode, self.report
        if not mode.advance_target(report.statusword, report.displayed_mode, period_s):
            return
        if mode.phase is Phase.ASKING:
            self.estimate.begin_planned()
        elif mode.phase is Phase.FAILED:
            node = self.drive.node.label
            log.error("the drive does not take the target", node=node, axis=self.number)
            self.brake(self.setpoint.deceleration)

    def _note_off(self) -> None:
        """Take note of a power stage that is off."""
        if self.power.note_off(self.report.statusword, self.report.state):
            self.mode.bits = 0
            self.power.lost = self.mode.lost or self.power.lost
        self.mode.forget()
        if not self.activity.is_idle:
            self.hold()
            self.activity.complete = False

    def _join_quick_stop(self) -> None:
        """Stop in a quick stop that the drive has begun: what comes after it would be a jump."""
        if self.activity.is_idle:
            return
        if self.activity.operation is not Operation.STOPPING:
            node = self.drive.node.label
            log.error("the drive has begun a quick stop", node=node, axis=self.number)
            self.brake(self.options.quick_stop_deceleration_rad_s2)
        self.power.quick_stop()

    def _watch_mode(self) -> None:
        """Stop a drive that has left the commanded mode: another program commands its motor.

        A setpoint that went on would be a jump when the drive comes back to the mode.
        """
        if self.mode.watch(self.report.displayed_mode, self.report.period_s):
            node = self.drive.node.label
            log.error(self.mode.lost, node=node, axis=self.number)
            self.brake(self.options.quick_stop_deceleration_rad_s2)
            self.power.quick_stop()

    def _watch_operation(self) -> None:
        # A drive may show for some time that it has reached the target of the move before.
        reached = self.report.statusword & StatusBits.TARGET_REACHED and self.estimate.ended
        match self.activity.operation:
            case Operation.STOPPING if self.activity.guided:
                self._end_guiding()
            case Operation.POSITION if reached and self.mode.phase is Phase.DONE:
                self._end_move()
            case Operation.VELOCITY if self.setpoint.target_velocity == 0 and self._is_at_rest():
                self.hold()
            case Operation.STOPPING if self._is_at_rest():
                if not self.mode.requested.is_cyclic_position:
                    self.setpoint.position = self.present_position()
                self.hold()
            case _:
                pass

    def _end_guiding(self) -> None:
        """Return a drive that rests in its quick stop to its position mode, held where it is.

        It has the measured position as its target before its mode is changed, and the mode before
        it operates again. A drive that keeps its mode in a quick stop remains there; the next
        command names that.
        """
        report, mode = self.report, self.mode
        at_rest = self._is_at_rest()
        if report.state is DriveState.QUICK_STOP_ACTIVE:
            self.setpoint.position = report.position
            if not at_rest:
                return
            self._returning_s += report.period_s
            mode.requested, mode.bits = rest_mode(self.options, CommandMode.POSITION), 0
            if report.displayed_mode == mode.requested:
                self.power.leave_quick_stop()
            elif self._returning_s > _RETURN_TIMEOUT_S:
                self.hold()
        elif at_rest and report.displayed_mode == mode.requested and not mode.requested.is_torque:
            self.setpoint.torque = 0.0
            self.hold()

    def _end_move(self) -> None:
        limited = self.report.statusword & StatusBits.INTERNAL_LIMIT
        self.activity.complete = not limited
        if limited:
            node = self.drive.node.label
            log.error("the drive stops at a limit of its own", node=node, axis=self.number)
            self.setpoint.position = self.present_position()
        else:
            self.setpoint.position = self.setpoint.target_counts * self.scaling.position
        self.hold()

    def _is_at_rest(self) -> bool:
        """Return True for an axis whose command is 0 and whose motor is at rest."""
        enabled = self.report.state is DriveState.OPERATION_ENABLED
        commanded = self.mode.requested.is_ours and self.setpoint.velocity != 0.0 and enabled
        turn = self.drive.velocity_turn
        return self.activity.is_at_rest(self.report.velocity, turn, commanded=commanded)

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
            return report.position, 0.0 if self.activity.guided else report.velocity
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
            report.known, report.powered, report.in_alarm or bool(self.mode.lost),
            report.digital_inputs,
            self.scaling.polarity, activity.operation, activity.complete, activity.home_done,
            self.mode.command_mode, self.power.lost, self.mode.lost,
        )  # fmt: skip
        if state == self._shown and not report.in_alarm and not image.offline[number]:
            return
        self._shown = state
        known, powered, alarm, _, _, operation, complete, home_done, mode, off, elsewhere = state
        image.offline[number], image.servo_on[number] = not known, powered
        image.amp_alarm[number] = alarm
        image.alarm_code[number] = (report.error_code or _GENERIC_ERROR) if alarm else 0
        image.reason[number] = self._reason(elsewhere or off)
        image.operation[number], image.motion_complete[number] = operation, complete
        image.home_done[number], image.mode[number] = home_done, mode
        negative, positive, home = report.switches()
        image.negative_limit[number], image.positive_limit[number] = negative, positive
        image.home_switch[number] = home

    def _reason(self, lost: str) -> str:
        """Return why the axis cannot move, beginning with the node; "" if it can.

        ``lost``: as ``ModeControl.lost`` and ``PowerStage.lost``.
        """
        node, report = self.drive.node, self.report
        if not report.known:
            return f"{node.label}: {node.fault or self.drive.awaited}"
        if report.in_alarm:
            return f"{node.label}: {report.alarm_text}"
        return f"{node.label}: {lost}" if lost else ""
