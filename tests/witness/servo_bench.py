"""Robots of serial servos on independent stand-ins of them, in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, ClassVar
from unittest.mock import patch

from tests.plugins.feetech.stand_in_backend import TrippedServo
from tests.plugins.serial_servo import dxl_bus, dxl_servo, sts_bus
from tests.plugins.serial_servo.joints import STEP_RAD
from tests.plugins.serial_servo.serial_line import SerialLine
from tests.plugins.serial_servo.simulated_servo import SimulatedServo
from tests.witness.bench import Bench
from tests.witness.servo_clock import ServoClock
from tests.witness.servo_line import ServoLine
from tests.witness.tapped_servo import ServoTap

from robotd.descriptor import RobotDescriptor
from robotd.device.capabilities import Capability
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

JOINTS = 2
ZEROS, POLARITIES = (2048, 2100), (1, -1)
POWERLESS_S = 0.1
MAX_JITTER = 0.1  # periods; a lost reply makes an exchange longer by 8 ms
OVERLOAD = 0x20
DAMAGED = 0.4  # of the replies, while the line is noisy
NOISY_S = 0.3
PORT = "/dev/servos"


class Wire(SerialLine):
    """A line on which what writes may get lost alone.

    Attributes:
        instruction: that is executed now.
        deaf: servos that do not get what writes.
    """

    place: ClassVar[int]  # of the instruction in a frame
    instruction = 0
    deaf: frozenset[SimulatedServo] = frozenset()

    def execute(self, frame: bytes, end: float) -> None:
        self.instruction = frame[self.place]
        super().execute(frame, end)  # type: ignore[safe-super]

    def receives(self, servo: SimulatedServo, baud: int) -> bool:
        writes = self.instruction in {sts_bus.WRITE, sts_bus.SYNC_WRITE}  # of both families
        return not (writes and servo in self.deaf) and super().receives(servo, baud)


class StsWire(Wire, sts_bus.StsBus):
    place = 4


class DxlWire(Wire, dxl_bus.DxlBus):
    place = 7


def trip_sts(servo: Any) -> None:
    servo.tripped = OVERLOAD


def trip_dxl(servo: Any) -> None:
    servo.trip(OVERLOAD)


@dataclass(frozen=True)
class Family:
    """Stand-ins of one family, and what the tap reads of them.

    Attributes:
        speed_unit: of its speed register, ticks/s.
    """

    wire: Callable[..., Wire]
    servo: Callable[..., SimulatedServo]
    trip: Callable[[Any], None]
    torque_register: str
    full_torque: int
    speed_unit: float


FAMILIES = {
    "feetech": Family(StsWire, TrippedServo, trip_sts, "torque_limit", 1000, 1.0),
    "dynamixel": Family(
        DxlWire, dxl_servo.Servo, trip_dxl, "goal_pwm", dxl_servo.MAX_PWM,
        dxl_servo.VELOCITY_UNIT,
    ),
}  # fmt: skip


class ServoBench(Bench):
    """A robot that is not yet started; ``close`` when it is not needed any more.

    The judges are at the servos: each goal that one executes, the speed of its own profile, and how
    far it is from its goal when it gets torque.
    """

    has_hands = True
    clock: ServoClock

    def __init__(self, family: str, rate_hz: float = 100.0) -> None:
        self.prepare(JOINTS, rate_hz, base=False)
        self.clock = ServoClock()
        self._family, self._name, self._rate_hz = FAMILIES[family], family, rate_hz
        self.servos = [self._family.servo() for _ in self.judges]
        self.wire: Wire = self._family.wire(dict(enumerate(self.servos, 1)))
        self.line = ServoLine(self.wire, self.clock)
        for judge in self.judges:
            judge.rounding = STEP_RAD
            judge.speed_rounding = self._family.speed_unit * STEP_RAD
            judge.may_wait, judge.max_jitter = 1, MAX_JITTER
        self.taps = [
            ServoTap(
                servo, judge, zero, polarity, self._family.torque_register,
                self._family.full_torque, lambda: self.now_s, lambda: self.line.sent_s,
                lambda: self.wire.instruction == sts_bus.WRITE,
            )
            for servo, judge, zero, polarity in zip(
                self.servos, self.judges, ZEROS, POLARITIES, strict=True
            )
        ]  # fmt: skip
        self._ends: list[tuple[float, Callable[[], None]]] = []  # of faults
        self._quiet_s = 0.0  # until when answers are lost, or damaged
        self.clock.advanced = self.settle
        self._patches = ExitStack()
        modules = {f"serial_port.{name}": value for name, value in self.line.modules.items()}
        modules |= {"request_bus.time": self.line.time, "exchange.threading": self.clock.threading}
        for name, value in modules.items():
            self._patches.enter_context(patch(f"robotd_serial_servo.{name}", value))
        self.robot = self.make_robot()

    def make_robot(self) -> Robot:
        axes = [
            {"axis": axis, "servo": axis + 1, "zero_tick": zero, "polarity": polarity}
            for axis, (zero, polarity) in enumerate(zip(ZEROS, POLARITIES, strict=True))
        ]
        section = {"port": PORT, "axes": axes, "exchange_period_s": 1.0 / self._rate_hz}
        descriptor = RobotDescriptor.model_validate({
            **self.describe(self._rate_hz, {"servo_timeout_s": 1.0}),
            "backend": self._name,
            "backends": {self._name: section},
        })  # fmt: skip
        backend = load_backend(self._name)
        backend.capabilities |= {Capability.SIMULATED}  # here: the servos use this clock
        return Robot(descriptor, backend, self.clock)

    def close(self) -> None:
        self.clock.kill_bus()
        self._patches.close()

    def unplug(self) -> None:
        self.clock.kill_bus()
        self.line.unplug(0.0)
        exchange = vars(self.robot.connection._driver)["wrapped"].exchange
        if exchange is not None:
            exchange._fail("killed")  # its jobs, before they are collected as garbage

    def settle(self) -> None:
        """Let the servos live up to the present, and faults end."""
        for end in [end for end in self._ends if end[0] <= self.now_s]:
            self._ends.remove(end)
            end[1]()
        self.line.advance()
        for tap in self.taps:
            tap.take_stock()
            if self.now_s < self._quiet_s:
                tap.judge.lose_answer(self.now_s)

    def _until(self, seconds: float, end: Callable[[], None]) -> None:
        self.is_cut = True  # a servo goes on without its bus
        self._quiet_s = max(self._quiet_s, self.now_s + seconds)
        self._ends.append((self.now_s + seconds, end))

    def stall(self, seconds: float) -> None:
        """Suspend the control loop; the bus thread goes on, and the servos hold."""
        for judge in self.judges:
            judge.lose_answer(self.now_s + judge.period_s)  # one more target is under way
        super().stall(seconds)  # after a short one the bus thread may be first from now on

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        servos = [self.servos[axis] for axis in axes] or self.servos
        if how == "commands":
            self.wire.deaf |= frozenset(servos)
            self._until(seconds, self._hear)
            return
        name = "drop" if how == "answers" else "lose_request"
        for servo in servos:
            setattr(servo.faults, name, 1.0)
        self._until(seconds, lambda: self._clear(servos, name))

    def _hear(self) -> None:
        self.wire.deaf = frozenset()

    @staticmethod
    def _clear(servos: Sequence[SimulatedServo], name: str) -> None:
        for servo in servos:
            setattr(servo.faults, name, 0.0)

    def delay(self, seconds: float, delay_s: float, axes: Sequence[int] = ()) -> None:
        servos = [self.servos[axis] for axis in axes] or self.servos
        for servo in servos:
            servo.faults.delay, servo.faults.delay_s = 1.0, delay_s
        self._until(seconds, lambda: self._clear(servos, "delay"))

    def block(self, seconds: float) -> None:
        self.line.blocked_s = self.now_s + seconds
        self._until(seconds, self.line.advance)

    def cut_cable(self, seconds: float) -> None:
        """Take the adapter out, and plug it in again."""
        self.line.unplug(seconds)
        self._until(seconds, self.line.advance)

    def reset(self, axis: int) -> None:
        """Let a servo lose its power for a moment."""
        self.servos[axis].power_off()
        self._ends.append((self.now_s + POWERLESS_S, self.servos[axis].power_on))

    def trip(self, axis: int) -> None:
        self._family.trip(self.servos[axis])

    def refuse(self, axis: int) -> None:
        """Damage replies of a servo: wrong checksums, bits, and ends that are missing."""
        servo = self.servos[axis]
        names = ("wrong_checksum", "corrupt", "truncate")
        for name in names:
            setattr(servo.faults, name, DAMAGED)
        self._until(NOISY_S, lambda: [self._clear([servo], name) for name in names] and None)

    def push(self, axis: int, displacement: float) -> None:
        self.taps[axis].push(displacement)

    def heal(self) -> None:
        self.line.unplugged_s = self.line.blocked_s = self._quiet_s = 0.0
        self.is_cut = False
        for _, end in self._ends:
            end()
        self._ends.clear()
        for tap in self.taps:
            tap.let_go()
        self.line.advance()
        self.run(max((servo.boot_s for servo in self.servos if not servo.answering), default=0.0))
