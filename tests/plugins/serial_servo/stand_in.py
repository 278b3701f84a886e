"""A family's backend on its simulated bus, for the conformance kit.

Opening the device starts the bus, closing it ends it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from tests.plugins.serial_servo.joints import STEP_RAD
from tests.plugins.serial_servo.serial_line import SerialLine
from tests.plugins.serial_servo.simulated_servo import SimulatedServo

from robotd.api import Clock, FaultInjector, RobotDescriptor, Unsupported
from robotd_serial_servo.device import OpenBus, ServoDevice
from robotd_serial_servo.options import PlannedServo, SerialServoOptions, ServoKeys, ServoPlan

MIDDLE = 2048
FAULT_BITS = 0x3F  # of one byte, in both families


class StandInOptions(SerialServoOptions):
    """As those of ``family``, whose servos of the robot's file are taken.

    A robot without that section has one servo for each axis. Zeros that are not known are those of
    servos that are mounted in the middle.
    """

    family: ClassVar[str]

    reply_timeout_s: float = 0.05  # it shares the processor with everything
    lost_after_s: float = 0.3

    def check_robot(self, robot: RobotDescriptor) -> ServoPlan:
        """Tie servos to joints. Raises DescriptorError with every problem."""
        own = robot.backends.get(self.family, {}).get("axes", [])
        found = [ServoKeys.model_validate(keys) for keys in own] or [
            ServoKeys(axis=axis, servo=axis + 1) for axis in range(robot.axes)
        ]
        axes = tuple(_with_zero(keys) for keys in found)
        return ServoPlan.make(robot, self.model_copy(update={"axes": axes}))


def _with_zero(keys: ServoKeys) -> ServoKeys:
    if keys.zero_tick is not None:
        return keys
    return keys.model_copy(update={"zero_tick": MIDDLE - keys.middle_rad / STEP_RAD})


class StandInDevice(ServoDevice):
    """Starts the servos when it is opened, and ends them when it is closed.

    Args:
        make_servo: makes a servo whose shaft is at an angle in rad, 0 in the middle of its turn.
    """

    def __init__(
        self,
        robot: RobotDescriptor,
        plan: ServoPlan,
        clock: Clock,
        open_bus: OpenBus,
        make_line: Callable[[Mapping[int, SimulatedServo]], SerialLine],
        make_servo: Callable[[PlannedServo, float], SimulatedServo],
    ) -> None:
        super().__init__(robot, plan, clock, open_bus)
        self._make_line = make_line
        starts = {joint.axis: joint.initial_position for joint in robot.joints}
        self.servos = {
            servo.servo: make_servo(servo, _shaft(servo, starts.get(servo.axis, 0.0)))
            for servo in plan.servos
        }
        self.line: SerialLine | None = None

    def open(self, path: str = "", name: str = "") -> None:
        if self.line is None:
            self.line = self._make_line(self.servos).__enter__()
        super().open(self.line.port, name)

    def close(self) -> None:
        super().close()
        line, self.line = self.line, None
        if line is not None:
            line.__exit__(None, None, None)


def _shaft(servo: PlannedServo, angle: float) -> float:
    """Return the angle of a servo's shaft for that of its joint, rad."""
    return (servo.scale.zero - MIDDLE) * STEP_RAD + servo.scale.polarity * angle


class StandInFaults(FaultInjector):
    """Faults of the simulated servos.

    Args:
        trip: lets a servo report fault bits.
        shift: lets a servo count so many ticks more.
    """

    def __init__(
        self,
        device: StandInDevice,
        trip: Callable[[SimulatedServo, int], None],
        shift: Callable[[SimulatedServo, int], None],
    ) -> None:
        self._device, self._trip, self._shift = device, trip, shift

    def position(self, axis: int) -> float:
        planned, servo = self._of(axis)
        return planned.scale.polarity * (servo.joint.angle - _shaft(planned, 0.0))

    def move_by_hand(self, axis: int, delta: float) -> None:
        planned, servo = self._of(axis)
        servo.joint.move(servo.joint.angle + planned.scale.polarity * delta)

    def trip(self, axis: int, code: int) -> None:
        if code & ~FAULT_BITS:
            raise Unsupported(f"alarm 0x{code:X}: a servo has {FAULT_BITS:#x}")
        self._trip(self._of(axis)[1], code)

    def disconnect(self, axis: int) -> None:
        self._of(axis)[1].faults.lose_request = 1.0

    def reconnect(self, axis: int) -> None:
        self._of(axis)[1].faults.lose_request = 0.0

    def freeze(self, frozen: bool) -> None:
        for servo in self._device.servos.values():
            servo.faults.lose_request = float(frozen)

    def block(self, axis: int, blocked: bool) -> None:
        joint = self._of(axis)[1].joint
        joint.hold() if blocked else joint.release()

    def jump_encoder(self, axis: int, delta: float) -> None:
        planned, servo = self._of(axis)
        self._shift(servo, planned.scale.polarity * round(delta / STEP_RAD))

    def drop_communication(self) -> None:
        if self._device.line is not None:
            self._device.line.unplug()
            self._device.line.plug_in()

    def _of(self, axis: int) -> tuple[PlannedServo, SimulatedServo]:
        planned = self._device.plan.servos[axis]
        return planned, self._device.servos[planned.servo]
