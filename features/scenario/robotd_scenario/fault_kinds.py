"""Kinds of faults: their arguments, and how each is injected and removed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from robotd.api import Capability, InvalidArgument, unknown_name
from robotd.api.models import validate
from robotd.api.robots import Robot

AxisNumber = Annotated[int, Field(ge=0, le=127)]
Seconds = Annotated[float, Field(gt=0, le=1e6)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Byte = Annotated[int, Field(ge=0, le=7999)]
Bit = Annotated[int, Field(ge=0, le=7)]

OVERCURRENT = 0x2310  # CiA 402: continuous overcurrent


class Part(BaseModel):
    """Base of all models of a scenario: frozen, unknown keys are rejected."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class FaultKind(Part):
    """Base of all kinds. The control loop calls ``begin`` and ``end``; neither may block."""

    def check(self, robot: Robot) -> None:
        """Raise InvalidArgument when the fault does not fit the robot."""
        axis = getattr(self, "axis", 0)
        if axis >= len(robot.axes):
            raise InvalidArgument(f"axis {axis} is outside 0..{len(robot.axes) - 1}")

    @property
    def target(self) -> tuple[Any, ...]:
        """The thing that it changes: faults of one target override each other."""
        names = ("axis", "byte", "bit")
        return type(self), *(getattr(self, name) for name in names if hasattr(self, name))

    def state(self, robot: Robot) -> Any:
        """Return the state of the target, which ``end`` restores."""

    @abstractmethod
    def begin(self, robot: Robot) -> None:
        """Inject the fault."""

    def can_end(self, robot: Robot) -> bool:
        """Return False while ``end`` has to wait for the device."""
        return True

    def end(self, robot: Robot, before: Any) -> None:
        """Remove the fault; called after ``for_s`` where the kind has that field.

        ``before``: state of the target without faults.
        """


class AmpAlarm(FaultKind):
    """Amplifier alarm of one drive, until it is cleared."""

    axis: AxisNumber
    code: int = Field(OVERCURRENT, ge=1, le=0xFFFF)

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.trip(self.axis, self.code)


class FollowingError(FaultKind):
    """Blocked axis: it stays in place and does not follow its command."""

    axis: AxisNumber
    for_s: Seconds | None = None

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.block(self.axis, True)

    def end(self, robot: Robot, before: Any) -> None:
        robot.fault_injector.block(self.axis, False)


class SlaveLost(FaultKind):
    """Lost fieldbus slave of one axis; after ``for_s`` it rejoins with its servo off."""

    axis: AxisNumber
    for_s: Seconds | None = None

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.disconnect(self.axis)

    def can_end(self, robot: Robot) -> bool:
        return Capability.HOT_CONNECT not in robot.capabilities or robot.connection.ready

    def end(self, robot: Robot, before: Any) -> None:
        robot.fault_injector.reconnect(self.axis)
        if Capability.HOT_CONNECT in robot.capabilities:
            robot.fieldbus.start_hot_connect(0)


class PacketLoss(FaultKind):
    """Consecutive lost fieldbus frames."""

    count: int = Field(ge=1, le=1_000_000)

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.lose_packets(self.count)


class LateCycles(FaultKind):
    """Late control loop: ``count`` consecutive periods start ``late_s`` late."""

    late_s: float = Field(gt=0, le=10)
    count: int = Field(1, ge=1, le=100_000)

    def begin(self, robot: Robot) -> None:
        robot.control_loop.delay(self.late_s)


class StuckGripper(FaultKind):
    """Stuck gripper valve: it keeps its position whatever is commanded."""

    closed: bool
    for_s: Seconds | None = None

    def check(self, robot: Robot) -> None:
        if robot.descriptor.gripper is None:
            raise InvalidArgument(f"{robot.descriptor.name} has no gripper")

    def begin(self, robot: Robot) -> None:
        self._stick(robot, self.closed)

    def end(self, robot: Robot, before: Any) -> None:
        self._stick(robot, None)

    def _stick(self, robot: Robot, value: bool | None) -> None:
        if gripper := robot.descriptor.gripper:
            robot.fault_injector.stick_output_bit(gripper.output_byte, gripper.output_bit, value)


class InputBit(FaultKind):
    """Changed input bit; after ``for_s`` it is as it was before."""

    byte: Byte
    bit: Bit
    value: bool
    for_s: Seconds | None = None

    def check(self, robot: Robot) -> None:
        size, _ = robot.io.sizes
        if self.byte >= size:
            raise InvalidArgument(f"input byte {self.byte} does not exist, there are {size} bytes")

    def state(self, robot: Robot) -> bool:
        return robot.io.input_bit(self.byte, self.bit)

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.set_input_bit(self.byte, self.bit, self.value)

    def end(self, robot: Robot, before: Any) -> None:
        robot.fault_injector.set_input_bit(self.byte, self.bit, before)


class EncoderJump(FaultKind):
    """Jump of the measured position of one axis."""

    axis: AxisNumber
    delta_rad: float = Field(ge=-1e6, le=1e6)

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.jump_encoder(self.axis, self.delta_rad)


class MovedByHand(FaultKind):
    """Hand that turns one axis at once, whose servo is off, or which is guided by hand."""

    axis: AxisNumber
    delta_rad: float = Field(ge=-1e6, le=1e6)

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.move_by_hand(self.axis, self.delta_rad)


class CommunicationDrop(FaultKind):
    """Loss of the cyclic exchange; it can be started again."""

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.drop_communication()


class EngineStopped(FaultKind):
    """Crash of the device's motion engine."""

    def begin(self, robot: Robot) -> None:
        robot.fault_injector.stop_engine()


class Crossing(Part):
    """Trigger: the measured position of a joint crosses a value."""

    joint: str
    above_rad: Finite | None = None
    below_rad: Finite | None = None

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.above_rad is None) == (self.below_rad is None):
            raise ValueError("needs one of above_rad and below_rad")
        return self

    def check(self, robot: Robot) -> None:
        """Raise InvalidArgument when the robot has no such joint."""
        if self.joint not in robot.joint_names:
            raise InvalidArgument(unknown_name("joint", self.joint, robot.joint_names))

    def happens(self, robot: Robot) -> bool:
        """Return True while the joint is beyond the value."""
        axis = robot.joint_axes[robot.joint_names.index(self.joint)]
        position = float(robot.image.position[axis])
        if self.above_rad is not None:
            return position > self.above_rad
        return self.below_rad is not None and position < self.below_rad


class Fault(Part):
    """One fault: exactly one kind, and its trigger.

    Attributes:
        at_s: simulated seconds after the scenario began, or after the fault was injected.
        when: begins as soon as a joint crosses a value, but not before ``at_s``.
    """

    at_s: float = Field(0.0, ge=0, le=1e6)
    when: Crossing | None = None
    amp_alarm: AmpAlarm | None = None
    following_error: FollowingError | None = None
    slave_lost: SlaveLost | None = None
    packet_loss: PacketLoss | None = None
    late_cycles: LateCycles | None = None
    stuck_gripper: StuckGripper | None = None
    input_bit: InputBit | None = None
    encoder_jump: EncoderJump | None = None
    moved_by_hand: MovedByHand | None = None
    communication_drop: CommunicationDrop | None = None
    engine_stopped: EngineStopped | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = [name for name in FAULTS if getattr(self, name) is not None]
        if len(given) != 1:
            empty = [name for name in FAULTS if name in self.model_fields_set.difference(given)]
            hint = f"; without keys it is written {empty[0]}: {{}}" if empty else ""
            raise ValueError(f"needs exactly one of {', '.join(FAULTS)}{hint}")
        return self

    @property
    def name(self) -> str:
        """Name of the kind."""
        return next(name for name in FAULTS if getattr(self, name) is not None)

    @property
    def kind(self) -> FaultKind:
        kind: FaultKind = getattr(self, self.name)
        return kind

    def check(self, robot: Robot) -> None:
        """Raise InvalidArgument when the fault does not fit the robot."""
        self.kind.check(robot)
        if self.when is not None:
            self.when.check(robot)

    def __str__(self) -> str:
        values = self.kind.model_dump(exclude_none=True)
        return " ".join([self.name, *(f"{key}={value}" for key, value in values.items())])


def validate_fault(values: Any) -> Fault:
    """Return the fault of a mapping as in a scenario file. Raises DescriptorError."""
    return validate(Fault, values, None)


def requested_fault(kind: str, settings: Mapping[str, Any]) -> Fault:
    """Return the fault of a request.

    ``settings`` are those of the kind by name, and ``at_s``, ``when.joint`` and so on, which every
    fault has. Raises InvalidArgument: unknown kind; DescriptorError: wrong settings.
    """
    if kind not in FAULTS:
        raise InvalidArgument(unknown_name("fault", kind, FAULTS))
    own: dict[str, Any] = {}
    common: dict[str, Any] = {}
    for name, value in settings.items():
        if name == "at_s":
            common[name] = value
        elif name.startswith("when."):
            common.setdefault("when", {})[name.removeprefix("when.")] = value
        else:
            own[name] = value
    return validate_fault({**common, kind: own})


FAULTS = tuple(name for name in Fault.model_fields if name not in ("at_s", "when"))
