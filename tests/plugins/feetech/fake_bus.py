"""Fake bus: servos as register values, without a wire, a motor or a time of their own.

It models what decides about a jump: a goal switches on, torque limits, power loss, lost requests.
A servo that is on with torque is at its goal at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tests.fakes import FakeClock

from robotd_serial_servo.servo_bus import (
    Goal,
    NoReply,
    ServoBus,
    ServoIdentity,
    ServoState,
)


@dataclass
class FakeServo:
    position: int = 2000
    goal: int = 0
    torque: bool = False
    limit: float = 1.0
    error: int = 0
    silent: bool = False
    deaf: bool = False
    held: bool = False  # a hand or an obstacle keeps it
    jumps: list[int] = field(default_factory=list)  # distances that it moved at once, ticks

    def settle(self) -> None:
        if self.torque and self.limit > 0.0 and not self.held and self.goal != self.position:
            self.jumps.append(self.goal - self.position)
            self.position = self.goal

    def restart(self) -> None:
        self.goal, self.torque, self.limit, self.error = 0, False, 1.0, 0


class FakeServoBus(ServoBus):
    """``calls``: what was written, in order."""

    def __init__(self, clock: FakeClock, servos: Mapping[int, FakeServo]) -> None:
        self.clock, self.servos = clock, dict(servos)
        self.calls: list[tuple[object, ...]] = []
        self.closed = False

    def close(self) -> None:
        self.closed = True

    def ping(self, servo: int) -> bool:
        return servo in self.servos and not self.servos[servo].silent

    def identify(self, servo: int) -> ServoIdentity:
        self._there(servo)
        return ServoIdentity(servo, 777, "sts3215", "3.10", 0, (0, 4095), 0.0)

    def read(self, servos: Sequence[int]) -> Mapping[int, ServoState]:
        asked = {servo: self.servos[servo] for servo in servos}
        return {
            number: ServoState(
                self.clock.now_ns(), servo.position, 0.0, 0.0, servo.goal, servo.torque,
                servo.limit, 7.4, 30.0, 0.0, servo.error,
            )
            for number, servo in asked.items()
            if not servo.silent
        }  # fmt: skip

    def write_goals(self, goals: Mapping[int, Goal]) -> None:
        for number, goal in goals.items():
            self._goal("goal", number, goal)

    def seed(self, servo: int, goal: Goal) -> None:
        self._there(servo)
        self._goal("seed", servo, goal)

    def set_torque(self, servo: int, *, on: bool) -> None:
        self.calls.append(("torque", servo, on))
        self._there(servo).torque = on
        self.servos[servo].settle()

    def limit_torque(self, servo: int, part: float) -> None:
        self.calls.append(("limit", servo, part))
        self._there(servo).limit = round(part, 3)
        self.servos[servo].settle()

    def try_to_clear(self, servo: int) -> None:
        self.calls.append(("clear", servo))
        self._there(servo).error &= ~0x20

    def store(self, servo: int, offset: int, range_ticks: tuple[int, int]) -> None:
        self.calls.append(("store", servo, offset, range_ticks))

    def _goal(self, name: str, number: int, goal: Goal) -> None:
        self.calls.append((name, number, goal.position))
        servo = self.servos[number]
        if not servo.silent and not servo.deaf:
            servo.goal, servo.torque = goal.position, True
            servo.settle()

    def _there(self, servo: int) -> FakeServo:
        if servo not in self.servos or self.servos[servo].silent:
            raise NoReply(f"servo {servo} does not answer")
        return self.servos[servo]
