"""One axis as the cycle sees it: what is sent with each SYNC, and what the answers mean.

The fields are set by worker threads (``commands.py``), one command at a time, and acted upon
by the cycle. Nothing here blocks.
"""

from __future__ import annotations

import math
import threading

from robotd.api import CommandMode, Operation, ProcessImage, Profile, get_logger
from robotd_canopen.bus import Bus
from robotd_canopen.estimate import Estimate
from robotd_canopen.feedback import (
    DEMAND,
    ERROR_CODE,
    INPUTS,
    MODE,
    STATUSWORD,
    VELOCITY,
    Feedback,
)
from robotd_canopen.frame import Frame
from robotd_canopen.handshake import Handshake, Phase
from robotd_canopen.layout import AxisLayout
from robotd_canopen.modes import CYCLIC, OperationMode, rest_mode
from robotd_canopen.modes import VELOCITY as VELOCITY_MODES
from robotd_canopen.node import Node
from robotd_canopen.scaling import Scaling, wrapped
from robotd_canopen.states import FAULTY, POWERED, Control, DriveState, Status, drive_state

CONTROLWORD, OPERATION_MODE, TARGET_POSITION = 0x6040, 0x6060, 0x607A
TARGET_VELOCITY, INTERPOLATION = 0x60FF, 0x60C1
log = get_logger("canopen")

_RESTS_RAD_S = 0.01  # measured speed of a standing axis
_GENERIC_ERROR = 0x1000  # of a drive that has no number for its fault
_RESTING = 3  # SYNCs at that speed that make a standstill


class Axis:
    """Number ``number`` of the robot's axes.

    Attributes:
        node: the drive's node.
        control: controlword of the state machine; ``bits`` are added to it.
        mode: mode of operation that is asked for.
        position, velocity: setpoint, rad (or m) and per second.
        target_counts: target of a profile position move.
        deceleration: ramp of the stop that runs, or of the velocity that changes.
        operation, command_mode, home_done, complete: as in the image.
        following: setpoints come from ``stream``.
        wanted: the servo is meant to be on.
        sent: controlword of the last frame.
        lost: why the servo went off by itself; "" if it did not.
        state, status, displayed_mode: what the drive said, of one moment.
        profile_written: ramps and speeds that the drive has by SDO, by object.
    """

    def __init__(
        self, number: int, layout: AxisLayout, node: Node, feedback: Feedback, scaling: Scaling
    ) -> None:
        options = layout.options
        self.number, self.layout, self.node, self.scaling = number, layout, node, scaling
        self.lock = threading.RLock()
        self.command_mode = CommandMode.POSITION
        self.control = int(Control.DISABLE_VOLTAGE)
        self.bits = 0
        self.mode = rest_mode(options, self.command_mode)
        self.position, self.velocity = math.nan, 0.0
        self.target_counts = 0
        self.target_velocity = 0.0
        self.acceleration = self.deceleration = options.stop_deceleration_rad_s2
        self.operation = Operation.IDLE
        self.home_done = self.complete = self.following = self.wanted = False
        self.sent = -1
        self.lost = ""
        self.estimate = Estimate()
        self.handshake = Handshake()
        self._planned: tuple[float, Profile] | None = None
        self.profile_written: dict[int, int] = {}
        self.state = DriveState.UNKNOWN
        self.status = self.displayed_mode = 0
        self._feedback = feedback
        self._resting = 0
        self._frames = [
            (
                pdo,
                Frame(pdo.cob_id, bytes(pdo.layout.size)),
                [entry.base for entry in pdo.entries],
                (
                    pdo.holds(CONTROLWORD) or pdo.holds(OPERATION_MODE),
                    pdo.holds(TARGET_VELOCITY),
                    pdo.holds(TARGET_POSITION),
                ),
            )
            for pdo in layout.rpdos
        ]

    @property
    def powered(self) -> bool:
        return self.state in POWERED

    @property
    def measured(self) -> float:
        """Position, rad or m."""
        return float(self._feedback.counts[self.number]) * self.scaling.position

    def demand(self) -> float:
        """The drive's own position command; where it does not report one, the measured one."""
        if any(pdo.holds(DEMAND) for pdo in self.layout.tpdos):
            return self._feedback.demand(self.number) * self.scaling.position
        return self.measured

    def error_code(self) -> int:
        return self._said(ERROR_CODE)

    def transmit(self, bus: Bus, period_s: float, periods: int = 1) -> None:
        """Cycle: this SYNC's RPDOs, to take effect with the next SYNC.

        ``periods`` have passed since the SYNC before; the drive's own profiles have gone on.
        """
        self.estimate.advance(periods * period_s)
        self._advance(period_s)
        word = self.control | self.bits
        if self.mode is OperationMode.INTERPOLATED_POSITION and self.powered:
            word |= Control.ENABLE_INTERPOLATION
        for pdo, message, bases, holds in self._frames:
            if self._is_needed(*holds):
                values = [self._value(base, word) for base in bases]
                pdo.layout.pack_into(message.data, 0, *values)
                bus.send(message)
        self.sent = word

    def observe(self, image: ProcessImage) -> None:
        """Cycle: interpret what the drive said last, and write this axis' part of ``image``."""
        number, online = self.number, self.node.online
        self.status = self._said(STATUSWORD)
        self.displayed_mode = self._said(MODE)
        known = online and self._feedback.heard(number)
        self.state = drive_state(self.status) if known else DriveState.UNKNOWN
        if known:
            self._watch_power()
            self._watch_operation()
        elif self.operation is not Operation.IDLE:
            self.hold()
        powered, alarm = self.powered, self.state in FAULTY
        image.offline[number] = not known
        image.servo_on[number] = powered
        image.amp_alarm[number] = alarm
        image.alarm_code[number] = (self.error_code() or _GENERIC_ERROR) if alarm else 0
        image.reason[number] = self._reason(known=known, alarm=alarm)
        image.home_done[number] = self.home_done
        image.motion_complete[number] = self.complete
        image.mode[number] = self.command_mode
        image.operation[number] = self.operation
        self._report_command(image, known=known)
        inputs = self._said(INPUTS)
        ends = bool(inputs & 1), bool(inputs & 2)  # as the drive counts
        low, high = ends if self.scaling.polarity > 0 else (ends[1], ends[0])
        image.negative_limit[number], image.positive_limit[number] = low, high
        image.home_switch[number] = inputs & 4

    def brake(self, deceleration: float) -> None:
        """Stop what runs in the way of its mode; an idle axis is left alone."""
        if self.operation in (Operation.IDLE, Operation.STOPPING):
            return
        self.deceleration = deceleration
        self.following = False
        self.complete = False
        self._resting = 0
        self.target_velocity = 0.0
        self.operation = Operation.STOPPING
        self.estimate.stop(deceleration)
        if self.mode is OperationMode.PROFILE_POSITION:
            self.handshake.cancel()
            self.bits = self.handshake.bits
        elif self.mode is OperationMode.HOMING:
            self.control = int(Control.QUICK_STOP)

    @property
    def syncs(self) -> int:
        """SYNCs sent so far."""
        return self._feedback.syncs

    def resume(self) -> None:
        """The drive answers again and has kept its state: the command is where it stands."""
        self.position, self.velocity, self.target_velocity = self.demand(), 0.0, 0.0
        self.hold()

    def rebase(self) -> None:
        """The drive has set its position anew."""
        self._feedback.rebase(self.number)

    def begin_move(self, target: float, profile: Profile) -> None:
        """A profile position move to ``target``; the cycle hands it over to the drive."""
        self.deceleration = profile.deceleration
        self.target_counts = self.scaling.counts(target)
        halted = self.mode is OperationMode.PROFILE_POSITION and bool(self.bits & Control.HALT)
        if self.mode is not OperationMode.PROFILE_POSITION:
            self.estimate.rest(self.position)
        self._planned = target, profile
        self.handshake.begin(halted=halted)
        self.bits = self.handshake.bits
        self.operation = Operation.POSITION
        self.mode = OperationMode.PROFILE_POSITION

    def follow(self, position: float, velocity: float) -> None:
        """Cycle: a streamed setpoint; the position does not count in a velocity mode."""
        self.velocity = velocity
        if self.mode in VELOCITY_MODES:
            self.target_velocity = velocity
        else:
            self.position = position

    def forget(self) -> None:
        """The drive has been configured anew: nothing is known of it, and it is off."""
        self._feedback.forget(self.number)
        self.control, self.bits, self.wanted, self.lost = int(Control.DISABLE_VOLTAGE), 0, False, ""
        self.profile_written.clear()
        self.home_done = False
        self.hold()

    def hold(self) -> None:
        """Idle from now on, where the command stands."""
        self.operation = Operation.IDLE
        self.following = False
        self.velocity = 0.0

    def _advance(self, period_s: float) -> None:
        """The setpoint of the next SYNC, as far as nobody streams it."""
        if self.operation is Operation.POSITION:
            self._shake_hands(period_s)
        if self.operation is Operation.IDLE:
            self.estimate.rest(self.position)
        if not self.powered:
            self.position, self.velocity, self.target_velocity = self.measured, 0.0, 0.0
        elif self.mode in CYCLIC and self.operation is Operation.STOPPING:
            self.velocity = _towards(self.velocity, 0.0, self.deceleration * period_s)
            self.position += self.velocity * period_s
        elif self.mode is OperationMode.CYCLIC_VELOCITY and not self.following:
            slower = abs(self.target_velocity) < abs(self.velocity)
            ramp = self.deceleration if slower else self.acceleration
            self.velocity = _towards(self.velocity, self.target_velocity, ramp * period_s)

    def _said(self, index: int) -> int:
        """What the drive said last of the profile object ``index``."""
        return int(self._feedback.columns[index][self.number])

    def _reason(self, *, known: bool, alarm: bool) -> str:
        """Why the axis cannot move, beginning with the node; "" if it can."""
        node = self.node
        if not known:
            return f"node {node.id}: {node.fault or 'its PDOs have not come yet'}"
        if alarm:
            return f"node {node.id}: {node.alarm_text(self.error_code())}"
        return f"node {node.id}: {self.lost}" if self.lost else ""

    def _is_needed(self, common: bool, velocity: bool, target: bool) -> bool:
        """Whether an RPDO is sent in the present mode, by what it holds."""
        if velocity and not common:
            return self.mode in VELOCITY_MODES
        return common or not target or self.mode is OperationMode.PROFILE_POSITION

    def _value(self, base: int, word: int) -> int:
        """What the mapped object ``base`` holds now."""
        if base == CONTROLWORD:
            return word
        if base == OPERATION_MODE:
            return int(self.mode)
        if base == TARGET_VELOCITY:
            cyclic = self.mode is OperationMode.CYCLIC_VELOCITY
            return self.scaling.velocity_units(self.velocity if cyclic else self.target_velocity)
        if base == TARGET_POSITION and self.mode is OperationMode.PROFILE_POSITION:
            return wrapped(self.target_counts)
        if base in (TARGET_POSITION, INTERPOLATION) and math.isfinite(self.position):
            return wrapped(self.scaling.counts(self.position))
        return 0

    def _watch_power(self) -> None:
        """A drive that leaves its power stage by itself is not switched on again by us."""
        if self.wanted and not self.powered:
            self.wanted = False
            self.control, self.bits = int(Control.DISABLE_VOLTAGE), 0
            self.lost = f"statusword 0x{self.status:04X} ({self.state.value})"
        if not self.powered and self.operation is not Operation.IDLE:
            self.hold()
            self.complete = False

    def _watch_operation(self) -> None:
        match self.operation:
            case Operation.POSITION if self._is_reached():
                self.position = self.target_counts * self.scaling.position
                self.complete = True
                self.hold()
            case Operation.VELOCITY if self.target_velocity == 0 and self._stands():
                self.hold()
            case Operation.STOPPING if self._stands():
                self.position = self.position if self.mode in CYCLIC else self.demand()
                self.hold()
            case _:
                pass

    def _is_reached(self) -> bool:
        taken = self.handshake.phase is Phase.DONE
        return taken and bool(self.status & Status.TARGET_REACHED)

    def _shake_hands(self, period_s: float) -> None:
        """One SYNC of the handshake; the estimate begins when the drive is asked."""
        before = self.handshake.phase
        in_mode = self.displayed_mode == OperationMode.PROFILE_POSITION
        self.handshake.advance(self.status, in_mode=in_mode, period_s=period_s)
        self.bits, phase = self.handshake.bits, self.handshake.phase
        if phase is Phase.ASKING and before is Phase.ENTERING and self._planned is not None:
            hardest = self.layout.options.quick_stop_deceleration_rad_s2
            self.estimate.move(*self._planned, hardest)
        if phase is Phase.FAILED:
            log.error("the drive does not take the target", node=self.node.name)
            self.hold()

    def _stands(self) -> bool:
        """The command is at 0 (where it is ours) and the motor has been slow for some SYNCs."""
        ours = self.mode in CYCLIC or self.mode is OperationMode.CYCLIC_VELOCITY
        if ours and self.velocity != 0.0 and self.state is DriveState.OPERATION_ENABLED:
            self._resting = 0
            return False
        measured = self._said(VELOCITY) * self.scaling.velocity
        self._resting = self._resting + 1 if abs(measured) < _RESTS_RAD_S else 0
        return self._resting >= _RESTING

    def _report_command(self, image: ProcessImage, *, known: bool) -> None:
        number = self.number
        if not known:
            return
        ours = self.mode in CYCLIC or self.mode is OperationMode.CYCLIC_VELOCITY
        idle = self.operation is Operation.IDLE
        position = self.position if self.mode in CYCLIC or idle else self.estimate.position
        if not self.powered or self.mode in VELOCITY_MODES or self.mode is OperationMode.HOMING:
            position = self.measured
        image.position_command[number] = position
        image.velocity_command[number] = self.velocity if ours else self.estimate.velocity


def _towards(value: float, target: float, step: float) -> float:
    return min(target, value + step) if value < target else max(target, value - step)
