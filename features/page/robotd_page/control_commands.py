"""Commands of the page's control side: fields of each, and its calls of the robot."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, NamedTuple, Protocol

from pydantic import BaseModel, ConfigDict, Field

from robotd.api import ConnectError, Unsupported, reason_of
from robotd.api.robots import Robot

STOP_REASON = "by the stop button of the page"


class InjectsFaults(Protocol):
    """Faults of a simulation, offered as ``faults`` by another feature."""

    @property
    def fields(self) -> Mapping[str, list[dict[str, Any]]]:
        """``name``, ``type``, ``default`` and ``optional`` of each field, by kind of fault."""

    def inject(self, values: Mapping[str, Any]) -> str:
        """Inject a fault, and return it as text. Raises RobotdError with the reason."""


class Message(BaseModel):
    """Base of all messages of a page: frozen, unknown keys and other types are rejected."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


Finite = Annotated[float, Field(allow_inf_nan=False, strict=False)]


class Seen(Message):
    """State that a page showed when a button was pressed, by the robot's numbers.

    Attributes:
        events: ``seen`` of its newest state.
        time_s: of its newest sample, on the robot's clock.
    """

    events: Annotated[int, Field(ge=0)]
    time_s: Finite


class Access(NamedTuple):
    """Objects that a command may use.

    Attributes:
        robot: that it commands.
        faults: of a simulation; None: there are none.
        has_left: returns True once the client is gone. Any thread.
    """

    robot: Robot
    faults: InjectsFaults | None
    has_left: Callable[[], bool]


class Command(Message):
    """Base of the commands that a worker executes.

    Attributes:
        id: of the answer.
        seen: the state for which it was given; needed unless it is always allowed.
    """

    id: int
    seen: Seen | None = None

    def is_always_allowed(self, robot: Robot) -> bool:
        """Return True where it only reduces motion, so that it is never too late."""
        return False

    @abstractmethod
    def run(self, access: Access) -> str | dict[str, Any]:
        """Execute it. Worker. Raises RobotdError with the robot's reason.

        Returns what happened, as a sentence or as data for the page.
        """


class Question(Command):
    """Base of the commands that change nothing; the answer is data."""

    def is_always_allowed(self, robot: Robot) -> bool:
        return True


class Stop(Command):
    """Stop of all motion until a reset."""

    type: Literal["stop"]

    def is_always_allowed(self, robot: Robot) -> bool:
        return True

    def run(self, access: Access) -> str:
        access.robot.wait_stopped()  # the latch is engaged already
        return "stopped, at rest"


class Reset(Command):
    """End of a stop."""

    type: Literal["reset"]

    def run(self, access: Access) -> str:
        return access.robot.reset()


class Recover(Command):
    """Way back after a fault."""

    type: Literal["recover"]

    def run(self, access: Access) -> str:
        lines: list[str] = []
        access.robot.recover(lines.append)
        return "\n".join(lines) or "nothing to recover"


class SwitchServos(Command):
    """Servos of all joints and wheels."""

    type: Literal["servos"]
    on: bool

    def is_always_allowed(self, robot: Robot) -> bool:
        return not self.on

    def run(self, access: Access) -> str:
        robot = access.robot
        if self.on:
            robot.axes.stop_latch.check_servos()
            robot.servos.enable()
            return "servos are on"
        results = robot.axes.servos_off(robot.servos.used)
        failures = {robot.axes.names[axis]: error for axis, error in results.items() if error}
        if failures:
            reasons = {name: reason_of(error) for name, error in failures.items()}
            raise ConnectError("servos could not be switched off", reasons)
        return "servos are off"


class Grip(Command):
    """Closing or opening of the gripper."""

    type: Literal["gripper"]
    closed: bool

    def run(self, access: Access) -> str:
        robot = access.robot
        if robot.gripper is None:
            raise Unsupported("a gripper", robot.descriptor.name)
        robot.gripper.command(self.closed)
        return "gripper closes" if self.closed else "gripper opens"


class Speed(Command):
    """Speed override, 0 or 0.01 to 1."""

    type: Literal["speed"]
    speed: Annotated[float, Field(strict=False)]  # 1 is a number, too

    def is_always_allowed(self, robot: Robot) -> bool:
        return self.speed <= robot.axes.speed.speed

    def run(self, access: Access) -> str:
        access.robot.set_speed(self.speed)
        return f"speed {access.robot.axes.speed.text}"


class Pause(Command):
    """Pause of motion on its path, and its end."""

    type: Literal["pause"]
    paused: bool

    def is_always_allowed(self, robot: Robot) -> bool:
        return self.paused

    def run(self, access: Access) -> str:
        if self.paused:
            access.robot.pause()
        else:
            access.robot.resume()
        return f"speed {access.robot.axes.speed.text}"


class Output(Command):
    """Level of a named output."""

    type: Literal["output"]
    name: str
    value: bool

    def run(self, access: Access) -> str:
        access.robot.io.set_output(self.name, self.value)
        return f"{self.name} is {_level(self.value)}"


class OutputBit(Command):
    """Level of one bit of the output image."""

    type: Literal["output_bit"]
    byte: int
    bit: int
    value: bool

    def run(self, access: Access) -> str:
        access.robot.io.set_output_bit(self.byte, self.bit, self.value)
        return f"output {self.byte}.{self.bit} is {_level(self.value)}"


class OutputByte(Command):
    """Value of one byte of the output image."""

    type: Literal["output_byte"]
    byte: int
    value: Annotated[int, Field(ge=0, le=255)]

    def run(self, access: Access) -> str:
        access.robot.io.set_output_bytes(self.byte, bytes([self.value]))
        return f"output byte {self.byte} is {self.value}"


class Inject(Command):
    """Fault of the simulation, as in a scenario file."""

    type: Literal["inject"]
    fault: dict[str, Any]

    def run(self, access: Access) -> str:
        if access.faults is None:
            raise Unsupported("faults on request", access.robot.backend.name)
        return f"injected: {access.faults.inject(self.fault)}"


def _level(value: bool) -> str:
    return "on" if value else "off"
