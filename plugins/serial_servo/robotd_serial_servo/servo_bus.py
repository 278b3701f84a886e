"""Contract of a family of servos on a serial bus: what the exchange needs of its protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from robotd.api import RobotdError

TICKS_PER_TURN = 4096


class BusError(RobotdError):
    """A servo did not answer as it should."""


class NoReply(BusError):
    """No valid reply within the time limit."""


@dataclass(frozen=True)
class ServoState:
    """Registers of one servo, read in one piece.

    Attributes:
        time_ns: monotonic time at which they were asked for.
        position, goal: ticks, as the servo counts them.
        velocity: ticks/s.
        load: fraction of the maximum PWM, -1 to 1; not a torque.
        torque: the drive is on, by the servo's own register.
        torque_limit: fraction of the maximum torque, 0 to 1.
        voltage_v, temperature_c, current_a: measured; the current is NaN where there is no sensor.
        error: the servo's fault bits; 0 without a fault.
        expired: the servo has stopped because its bus was silent, and takes no goals.
        restarted: settings that are lost with the power are gone since torque was switched on.
    """

    time_ns: int
    position: int
    velocity: float
    load: float
    goal: int
    torque: bool
    torque_limit: float
    voltage_v: float
    temperature_c: float
    current_a: float
    error: int
    expired: bool = False
    restarted: bool = False


@dataclass(frozen=True)
class ServoIdentity:
    """One servo that answers, and its settings that survive power-off.

    Attributes:
        number: id on the bus.
        model: number of the model; ``model_name`` is "" for one that is not known.
        offset: ticks, in the sense of LeRobot's ``homing_offset``.
        range_ticks: lowest and highest goal that it accepts.
        reply_delay_s: between a request and its reply.
        trouble: why it cannot be driven by position within one turn; "": it can.
    """

    number: int
    model: int
    model_name: str
    firmware: str
    offset: int
    range_ticks: tuple[int, int]
    reply_delay_s: float
    trouble: str = ""


@dataclass(frozen=True)
class Goal:
    """Target of one servo.

    Attributes:
        position: ticks.
        speed: highest speed on the way there, ticks/s.
    """

    position: int
    speed: int


class ServoBus(ABC):
    """Servos of one family on one port. Bus thread only.

    What changes a register is read back: a method returns when the servo has confirmed it, and
    raises BusError when it has not. All methods raise PortLost.

    Attributes:
        corrupt: replies that were damaged, since the port was opened.
        offset_sign: a servo reports its true position less ``offset_sign`` times its offset.
    """

    corrupt: int = 0
    offset_sign: ClassVar[int] = 1

    @abstractmethod
    def close(self) -> None:
        """Close the port."""

    @abstractmethod
    def ping(self, servo: int) -> bool:
        """Return whether a servo answers."""

    @abstractmethod
    def identify(self, servo: int) -> ServoIdentity:
        """Read what a servo is."""

    @abstractmethod
    def read(self, servos: Sequence[int]) -> Mapping[int, ServoState]:
        """Return the states of those that answer, by one request."""

    @abstractmethod
    def write_goals(self, goals: Mapping[int, Goal]) -> None:
        """Send goals by one request, which no servo confirms. Only to servos that are on."""

    @abstractmethod
    def seed(self, servo: int, goal: Goal) -> None:
        """Write the goal of a servo, which some servos take as the order to switch on."""

    @abstractmethod
    def set_torque(self, servo: int, *, on: bool) -> None:
        """Switch the drive of a servo on or off."""

    @abstractmethod
    def limit_torque(self, servo: int, part: float) -> None:
        """Limit the drive of a servo to ``part`` of all, 0 to 1; lost at power-off."""

    @abstractmethod
    def try_to_clear(self, servo: int) -> None:
        """Do what clears a latched fault of a servo whose drive is off; without one: no effect."""

    @abstractmethod
    def store(self, servo: int, offset: int, range_ticks: tuple[int, int]) -> None:
        """Store offset and range of a servo for good; its drive is off afterwards."""
