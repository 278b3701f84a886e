"""Hand guiding of a joint group: it begins at rest, and any stop ends it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from robotd.api import (
    NANOSECONDS,
    Capability,
    FloatArray,
    InvalidArgument,
    NotReady,
    Operation,
    OperationError,
    ProcessImage,
    get_logger,
)
from robotd.api.robots import JointGroup, Robot
from robotd_teach.joint_groups import joint_group

MAX_SPEED = 1.5  # of a joint, rad/s or m/s
TIMEOUT_S = 600.0
LEASE_S = 1.0
SPEED_WINDOW_S = 0.1  # over which speed is measured
SHORTEST_WINDOW_S = 0.04  # of positions that show a speed
REST_TIMEOUT_S = 5.0  # of joints that are to be held
OPERATOR = "by the operator"
GUIDING = int(Operation.GUIDING)
NOT_HELD = "the arm has no torque while it is guided, and falls: hold it, and say so (--held)"
log = get_logger("guiding")


class GuidingState(NamedTuple):
    """State of hand guiding.

    Attributes:
        joints: positions by joint, rad or m.
        speed: of the fastest joint, rad/s or m/s.
        left_s: until its time is over.
    """

    joints: dict[str, float]
    speed: float
    left_s: float


class HandGuiding:
    """Hand guiding of a robot: ``robot.feature(HandGuiding)``. Any worker thread.

    While a joint group is guided, every other command for its joints is rejected. The control loop
    ends guiding, and the joints are held where they come to rest, when a joint is moved faster than
    the limit, the time is over or the client silent, motion is stopped or paused, the device is not
    ready, or a joint is no longer guided. Nothing moves afterwards without a new command.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._session: _Session | None = None  # the newest
        self._lock = threading.Lock()  # of its start and end
        robot.control_loop.every(robot.descriptor.cycle.rate_hz, "hand guiding", self._look)

    @property
    def reason(self) -> str:
        """Reason of the last end of guiding; "" while it goes on. Any thread."""
        return self._session.reason if self._session else ""

    def begin(
        self,
        group: str = "",
        *,
        held: bool = False,
        max_speed: float = MAX_SPEED,
        timeout_s: float = TIMEOUT_S,
        lease_s: float | None = None,
    ) -> str:
        """Let the joints of a group be moved by hand; return when they can be, with a text.

        Args:
            group: joint group; "": the only one.
            held: somebody holds the arm; without effect where something carries it.
            max_speed: of each joint, rad/s or m/s, 0.1 to 10, and at most its velocity limit.
            timeout_s: after which it ends, 1 to 3600.
            lease_s: time without ``keep`` after which it ends, 0.2 to 60; None: none is needed.

        Raises:
            InvalidArgument: no such group, or a value out of its range.
            Unsupported: the backend has no hand guiding.
            NotReady: a joint cannot be guided now, or moves; nobody holds an arm that would fall.
        """
        _require("max_speed", max_speed, 0.1, 10.0)
        _require("timeout_s", timeout_s, 1.0, 3600.0)
        if lease_s is not None:
            _require("lease_s", lease_s, 0.2, 60.0)
        joints = joint_group(self._robot, group)
        if Capability.FALLS_WHEN_GUIDED in self._robot.capabilities and not held:
            raise NotReady(NOT_HELD)
        with self._lock:
            if self._session is not None and not self._session.reason:
                raise NotReady("joints are guided by hand already: end that first")
            speeds = np.minimum(max_speed, joints.follower.limits.velocity)
            session = _Session(joints, speeds, timeout_s, lease_s)
            self._robot.axes.begin_guiding(session.axes)
            session.begun_ns = self._robot.clock.now_ns()
            session.kept_ns = self._robot.rearming.listened_ns
            self._session = session
        log.info("joints are guided by hand", group=joints.name)
        return f"{', '.join(joints.joint_names)} can be moved by hand"

    def keep(self) -> GuidingState:
        """Return the state, and begin a new lease. Any thread; never blocks.

        Raises NotReady: no joints are guided; why it has ended.
        """
        session = self._session
        if session is None:
            raise NotReady("no joints are guided by hand")
        if session.reason:
            raise NotReady(f"hand guiding has ended: {session.reason}")
        session.kept_ns = self._robot.rearming.listened_ns
        positions = self._robot.image.copy().position[session.axes].tolist()
        elapsed_s = (self._robot.clock.now_ns() - session.begun_ns) / NANOSECONDS
        return GuidingState(
            dict(zip(session.group.joint_names, positions, strict=True)),
            float(session.speeds.max()),
            max(0.0, session.timeout_s - elapsed_s),
        )

    def end(self, reason: str = OPERATOR) -> str:
        """End it, and return when the joints are held, with the reason of its end.

        One that has ended is waited for.

        Raises:
            NotReady: no joints were guided.
            DeviceTimeout: joints are not at rest in time.
            OperationError: a joint could not be held, and is off.
        """
        with self._lock:
            session = self._session
            if session is None:
                raise NotReady("no joints are guided by hand")
            session.reason = session.reason or reason
            axes = self._robot.axes
            axes.stop_and_wait(session.axes, REST_TIMEOUT_S)
            image = axes.image.copy()
            off = [axis for axis in session.axes if not image.servo_on[axis]]
        if off:
            told = [f"{axes.names[axis]}: {image.reason[axis] or 'servo is off'}" for axis in off]
            raise OperationError(f"{session.text}, and joints are off: {'; '.join(told)}")
        return f"{session.text}; the joints are held"

    @contextmanager
    def guided(
        self,
        group: str = "",
        *,
        held: bool = False,
        max_speed: float = MAX_SPEED,
        timeout_s: float = TIMEOUT_S,
    ) -> Iterator[None]:
        """Guide in the block, and hold the joints after it; see ``begin`` and ``end``."""
        self.begin(group, held=held, max_speed=max_speed, timeout_s=timeout_s)
        try:
            yield
        finally:
            self.end()

    def _look(self, image: ProcessImage) -> None:
        """End it for a reason. Control loop, once a period."""
        session = self._session
        if session is None or session.reason:
            return
        session.measure(image)
        session.reason = self._reason(session, image)
        if session.reason:
            self._robot.axes.stops.request(session.axes)
            log.warning("hand guiding has ended", reason=session.reason)

    def _reason(self, session: _Session, image: ProcessImage) -> str:
        """Return why it has to end; "" while it goes on."""
        axes = self._robot.axes
        if reason := axes.stop_latch.cause or axes.speed.rejection:
            return reason
        if not axes.connection.ready:
            return axes.connection.rejection
        operations = image.operation[session.axes].tolist()
        for axis, operation in zip(session.axes, operations, strict=True):
            if operation != GUIDING:
                return f"{axes.names[axis]}: {image.fault(axis) or 'stopped, or servo off'}"
        now_ns, listened_ns = self._robot.clock.now_ns(), self._robot.rearming.listened_ns
        return session.too_fast() or session.too_long(now_ns, listened_ns)


class _Session:
    """One time of being guided.

    Attributes:
        axes: of the joints.
        reason: why it has ended; "" while it goes on.
        begun_ns, kept_ns: its start on the robot's clock, and that of the lease in
            ``listened_ns``: a computer that stalls ends no lease.
        speeds: (m,) measured, rad/s or m/s.
    """

    def __init__(
        self, group: JointGroup, limits: FloatArray, timeout_s: float, lease_s: float | None
    ) -> None:
        self.group, self.axes = group, list(group.joint_axes)
        self.timeout_s, self.lease_s = timeout_s, lease_s
        self.begun_ns = self.kept_ns = 0
        self.reason = ""
        self.speeds = np.zeros(len(self.axes))
        self._limits = limits
        self._seen: deque[tuple[int, FloatArray]] = deque()  # times and positions

    @property
    def text(self) -> str:
        return f"hand guiding has ended: {self.reason}"

    def measure(self, image: ProcessImage) -> None:
        """Note positions, and the speed over the last ``SPEED_WINDOW_S``."""
        seen, now_ns = self._seen, image.fresh_ns
        if seen and now_ns <= seen[-1][0]:
            return
        seen.append((now_ns, image.position[self.axes]))
        while len(seen) > 2 and now_ns - seen[1][0] >= SPEED_WINDOW_S * NANOSECONDS:
            seen.popleft()
        elapsed_s = (now_ns - seen[0][0]) / NANOSECONDS
        if elapsed_s >= SHORTEST_WINDOW_S:
            self.speeds = np.abs(seen[-1][1] - seen[0][1]) / elapsed_s

    def too_fast(self) -> str:
        """Return which joint is faster than its limit; "": none is."""
        excess = self.speeds - self._limits
        joint = int(excess.argmax())
        if excess[joint] <= 0.0:
            return ""
        unit = self.group.follower.limits.units[joint]
        return (
            f"{self.group.joint_names[joint]} was moved at {self.speeds[joint]:.2f} {unit}/s, the"
            f" limit is {self._limits[joint]:g} {unit}/s"
        )

    def too_long(self, now_ns: int, listened_ns: int) -> str:
        """Return which time is over at ``now_ns`` on both clocks; "": none is."""
        if now_ns - self.begun_ns > self.timeout_s * NANOSECONDS:
            return f"its time of {self.timeout_s:g} s is over"
        silent_ns = listened_ns - self.kept_ns
        if self.lease_s is not None and silent_ns > self.lease_s * NANOSECONDS:
            return f"its client has been silent for {self.lease_s:g} s"
        return ""


def _require(name: str, value: float, low: float, high: float) -> None:
    """Raise InvalidArgument for a value out of its range."""
    if not low <= value <= high:
        raise InvalidArgument(f"{name} is {value:g}, must be {low:g} to {high:g}")
