"""One axis of a started robot, as the commissioning steps use it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from robotd.api import (
    BusNode,
    OperationError,
    ProcessImage,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd.api.models import JointSettings
from robotd.api.robots import JointStream, Robot
from robotd_commissioning.findings import in_words

log = get_logger("commissioning")

SILENCE_S = 0.2  # without a command of the held key the axis slows to rest
JAMMED = {"rad": 0.0087, "m": 0.5e-3}  # following error of a slow motion, rad or m
SLOWEST_LAG_S = 0.2  # lag of the slowest position loop
JAMMED_TICKS = 15  # calls of ``move`` in succession, so that no stall looks like a jam
MIN_SPEED = {"rad": 0.01, "m": 1e-3}  # below it, an error says nothing about the lag
ONLINE_TIMEOUT_S = 3.0  # for the first values of the drive
OWNER = "commissioning"


class HeldJog:
    """Motion of the axis while a key is held. One thread.

    Attributes:
        lag_s: largest following error over the speed of the command.
        travel: commanded since the start, rad or m.
    """

    def __init__(self, stream: JointStream, axis: CommissionedAxis) -> None:
        self.lag_s = self.travel = 0.0
        self._stream, self._axis, self._late = stream, axis, 0
        self._start = axis.image().position_command[axis.number]

    def move(self, velocity: float) -> None:
        """Move at ``velocity``, rad/s or m/s, for ``SILENCE_S`` at most.

        Raises OperationError: the stream has ended by a fault, or the axis does not follow.
        """
        if not self._stream.open:
            raise OperationError(self._stream.message)
        self._stream.send_velocity([velocity])
        image, axis = self._axis.image(), self._axis.number
        command, measured = image.position_command[axis], image.position[axis]
        error, speed = abs(command - measured), abs(image.velocity_command[axis])
        self.travel = float(command - self._start)
        unit = self._axis.unit
        self._late = self._late + 1 if error > JAMMED[unit] + speed * SLOWEST_LAG_S else 0
        if self._late >= JAMMED_TICKS:
            raise OperationError(
                f"{self._axis.joint.name} does not follow: commanded {in_words(command, unit)},"
                f" measured {in_words(measured, unit)}; it is jammed, its brake is closed, or the"
                " drive belongs to another axis"
            )
        if speed > MIN_SPEED[unit]:
            self.lag_s = max(self.lag_s, float(error / speed))


class CommissionedAxis:
    """Axis of one joint: position, drive, servo, motion and homing.

    Args:
        robot: started without servos, with this joint alone, so that no other axis is needed.
    """

    def __init__(self, robot: Robot) -> None:
        self.joint: JointSettings = robot.descriptor.joints[0]
        self.number, self.unit = self.joint.axis, self.joint.unit
        self._robot = robot

    def image(self) -> ProcessImage:
        """Return a consistent copy of the process image."""
        return self._robot.image.copy()

    def position(self) -> float:
        """Return the measured position, rad or m.

        Waits for the first one. Raises OperationError: the drive stays offline.
        """
        self._robot.connection.require_ready()
        live = self._robot.image
        if not wait_until(
            lambda: not live.offline[self.number], ONLINE_TIMEOUT_S, self._robot.clock
        ):
            raise OperationError(f"{self.joint.name}: {live.fault(self.number)}")
        return float(self.image().position[self.number])

    def node(self, number: int) -> BusNode | None:
        """Return the fieldbus node ``number``; None where there is none."""
        nodes = self._robot.fieldbus.status(0).nodes
        return next((node for node in nodes if node.id == number), None)

    def read_object(self, node: int, index: int, subindex: int) -> int:
        """Return an unsigned object of a fieldbus node. Raises OperationError, DeviceTimeout."""
        return int.from_bytes(self._robot.fieldbus.read_object(0, node, index, subindex), "little")

    @property
    def cautions(self) -> Sequence[str]:
        """Dangers of the drives that the operator has to know."""
        return self._robot.cautions

    @property
    def can_home(self) -> bool:
        """The backend supports homing."""
        return "homing" in self._robot.capabilities

    def home(self) -> None:
        """Home the axis, whose servo is on; blocks. Raises OperationError."""
        self._robot.axes.home(self.number)

    def stop(self) -> None:
        """Start a controlled stop. Any thread."""
        with suppress(RobotdError):
            self._robot.axes.stop([self.number])

    @contextmanager
    def powered(self) -> Iterator[None]:
        """Switch the servo on for the block; nothing moves."""
        axes = self._robot.axes
        axes.clear_alarm(self.number)
        axes.servo(self.number, True)
        try:
            yield
        except BaseException:
            try:
                self._switch_off()
            except RobotdError as failure:
                log.error("servo off failed", axis=self.joint.name, reason=str(failure))
            raise
        self._switch_off()

    def _switch_off(self) -> None:
        axes = self._robot.axes
        try:
            with suppress(RobotdError):
                axes.stop_and_wait([self.number], 2.0)
        finally:
            axes.servo(self.number, False)

    @contextmanager
    def held_motion(self) -> Iterator[HeldJog]:
        """Stream to the powered axis for the block; it is at rest at the end."""
        streams = self._robot.groups.of([self.joint.name]).stream
        with streams([self.joint.name], timeout_s=SILENCE_S, owner=OWNER) as stream:
            yield HeldJog(stream, self)
