"""Independent servos with a tap on each goal that they execute, and on their own set-points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.plugins.serial_servo.joints import STEP_RAD
from tests.plugins.serial_servo.simulated_servo import SimulatedServo
from tests.witness.judge import Command, Judge

HAND_RAD_S = 1.5
WEAK = 0.3  # of the torque: against more a hand lets go


class ServoTap:
    """Hands the commands of one servo to its judge, and is the hand that moves its joint.

    Args:
        zero, polarity: ticks of the joint's 0, and 1 or -1.
        full_torque: value of ``torque_register`` for all of it.
        now_s: simulated time.
        sent_s: when what the servo executes now was sent.
        is_alone: it was sent to this servo alone, and not with the cyclic goals of all.
    """

    def __init__(
        self,
        servo: SimulatedServo,
        judge: Judge,
        zero: float,
        polarity: int,
        torque_register: str,
        full_torque: int,
        now_s: Callable[[], float],
        sent_s: Callable[[], float],
        is_alone: Callable[[], bool],
    ) -> None:
        self.servo, self.judge = servo, judge
        self._zero, self._polarity = zero, polarity
        self._torque_register, self._full_torque = torque_register, full_torque
        self._now_s, self._sent_s, self._is_alone = now_s, sent_s, is_alone
        self._torque = 0.0  # part of the torque that the servo may use
        self._setpoint = servo.profile.position
        self._hand: float | None = None  # shaft angle to which a hand moves it
        tapped: Any = servo
        self._write, self._drive = tapped.write, tapped.drive
        tapped.write, tapped.drive = self.write, self.drive

    def angle(self, ticks: float) -> float:
        """Return the angle of the joint, rad."""
        return self._polarity * (ticks - self._zero) * STEP_RAD

    @property
    def is_on(self) -> bool:
        return self.servo.answering and self.servo.output_on

    def push(self, displacement: float) -> None:
        """Let a hand move the joint by ``displacement`` rad, while the servo has little torque."""
        angle = self.servo.joint.angle + displacement
        self._hand = max(-2.5, min(2.5, angle))

    def write(self, address: int, data: bytes) -> Any:
        servo, place = self.servo, self.angle(self.servo.profile.position)
        answer = self._write(address, data)
        written = {write.name for write in servo.writes}
        servo.writes.clear()
        self.take_stock()
        if "goal_position" not in written or not self.is_on:
            return answer
        now_s, goal = self._now_s(), self.angle(servo.get("goal_position"))
        if self._is_alone():
            self.judge.seed(Command(now_s, goal, place=self.angle(servo.reported())))
        else:
            self.judge.execute(Command(now_s, goal, sent_s=self._sent_s(), place=place))
        return answer

    def take_stock(self) -> None:
        """Report the power stage, and the distance to the goal where there is more torque."""
        servo, torque = self.servo, 0.0
        if self.is_on:
            torque = servo.get(self._torque_register) / self._full_torque
        self.judge.power(self._now_s(), self.is_on)
        if torque > self._torque:
            displacement = self.angle(servo.get("goal_position")) - self.angle(servo.reported())
            self.judge.pull(self._now_s(), displacement)
        self._torque = torque

    def drive(self, dt: float) -> None:
        servo = self.servo
        if self._hand is not None:
            self._move_by_hand(dt)
        before = servo.profile.position
        self._drive(dt)
        self.take_stock()
        if self.is_on and self._torque:
            speed = (servo.profile.position - before) * STEP_RAD / dt
            self.judge.profile(servo.now, self._polarity * speed)

    def _move_by_hand(self, dt: float) -> None:
        joint, end = self.servo.joint, self._hand
        assert end is not None
        step = HAND_RAD_S * dt
        if self._torque > WEAK or abs(end - joint.angle) <= step:
            self.let_go()
        else:
            joint.release()
            joint.hold(joint.angle + max(-step, min(step, end - joint.angle)))

    def let_go(self) -> None:
        """End what a hand does."""
        self._hand = None
        self.servo.joint.release()
