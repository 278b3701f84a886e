"""Robots in simulated time with judges at their drives: what all kinds of them have."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from tests.contract.base_clock import BaseClock
from tests.plugins.independent.knobs import Knobs
from tests.witness.judge import Judge

from robotd.clock import NANOSECONDS
from robotd.clock.simulated import SteppedClock
from robotd.motion.profile import Profile
from robotd.robot import Robot

COUNTS_PER_RAD = 1_000_000
RATED_TORQUE, TORQUE_LIMIT = 20.0, 10.0  # N·m
VELOCITY, ACCELERATION = 3.14, 12.0
TRAJECTORY = {"acceleration_margin": 0.2}  # else points may ask for any acceleration
OVERCURRENT = 0x2310
STEP_S = 0.005  # longest step of the drives' time
WHEELS = 2
CR3A_BENT = (0.0, 0.3, 1.4, -0.2, 1.2, 0.0)
DRIVE = {
    "wheel_radius_m": 0.1, "wheel_separation_m": 0.5, "wheel_velocity_rad_s": 12.0,
    "velocity_m_s": 1.0, "acceleration_m_s2": 2.0, "deceleration_m_s2": 2.0, "jerk_m_s3": 20.0,
    "angular_velocity_rad_s": 2.0, "angular_acceleration_rad_s2": 4.0,
    "angular_deceleration_rad_s2": 4.0, "angular_jerk_rad_s3": 40.0,
}  # fmt: skip
# Of a wheel that drives ahead and turns with all that the base may.
WHEEL_VELOCITY, WHEEL_ACCELERATION = 12.0, (2.0 + 4.0 * 0.5 / 2) / 0.1


class WitnessClock(SteppedClock):
    """Simulated time; ``advanced`` is called when it has advanced, before a period that is due."""

    def __init__(self) -> None:
        super().__init__()
        self.advanced: Callable[[], None] = lambda: None

    def attach(self, period_ns: int, period: Callable[[int], int]) -> None:
        def advance(due_ns: int) -> int:
            self.advanced()
            return period(due_ns)

        super().attach(period_ns, advance)

    def sleep_until_ns(self, deadline_ns: int) -> None:
        super().sleep_until_ns(deadline_ns)
        self.advanced()


class WheelClock(WitnessClock, BaseClock):
    """As ``WitnessClock``, for a robot with a base, whose thread waits for this time."""

    def sleep_until_ns(self, deadline_ns: int) -> None:
        if self.is_of_base:
            BaseClock.sleep_until_ns(self, deadline_ns)  # time advances in the main thread only
        else:
            super().sleep_until_ns(deadline_ns)


class Bench:
    """A robot, its clock, and what is at the drives.

    Attributes:
        judges: of each axis.
        joints: number of the first axes, which are joints; after them are the wheels of a base.
        is_cut: no command gets to a device that does not switch off by itself.
        has_hands: joints can be moved by hand while they have no torque.
        middle: of the ranges in which joints are moved, rad; none: 0.
        bent: joints of an arm at which its tool can move in each direction, rad; empty: no
            sequences of the tool are asked for. ``bent_joints``: what it can be.
        seconds_per_rad, profile: of paths, and of moves and jogs in whose midst faults come.
    """

    robot: Robot
    clock: WitnessClock
    judges: list[Judge]
    joints: int
    is_cut = False
    has_hands = False
    middle: Sequence[float] = ()
    bent: Sequence[float] = ()
    bent_joints: Sequence[float] = ()
    seconds_per_rad = 0.6
    profile = Profile(1.5, 8.0, 8.0)

    def prepare(self, axes: int, rate_hz: float, *, base: bool) -> None:
        """Make the clock, and the judges of ``axes`` joints; ``base``: of two wheels, too."""
        self.clock = WheelClock() if base else WitnessClock()
        self.joints = axes
        self.judges = judges_of(axes, 1.0 / rate_hz)
        if base:
            self.judges += [
                Judge(f"wheel{side}", WHEEL_VELOCITY, WHEEL_ACCELERATION, 1.0 / rate_hz)
                for side in range(WHEELS)
            ]

    def describe(self, rate_hz: float, engine: dict[str, Any] | None = None) -> dict[str, Any]:
        """Return a descriptor of joints and wheels, without its backend."""
        found = {
            "schema": 1, "name": "witness", "summary": "joints and wheels at a witness",
            "axes": len(self.judges), "cycle": {"rate_hz": rate_hz, "realtime_priority": 0},
            "trajectory": TRAJECTORY,
            "engine": {"open_tries": 1, "servo_timeout_s": 0.5, **(engine or {})},
            "joints": joints(self.joints),
        }  # fmt: skip
        if len(self.judges) > self.joints:
            sides = {"left_axis": self.joints, "right_axis": self.joints + 1}
            found["drive"] = {**sides, **DRIVE}
        return found

    def take(self, robot: Robot) -> Robot:
        """Return a robot that is made, after its clock has been set to it."""
        if isinstance(self.clock, WheelClock):
            self.clock.guide(robot)
        return robot

    def run(self, seconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NANOSECONDS))

    def stall(self, seconds: float) -> None:
        """Suspend the control loop, as on an overloaded computer; the drives go on.

        Its periods begin anew from then on. A real loop keeps to their grid: after less than a
        period nothing is judged that the new one changes.
        """
        self.clock.detach()
        self.run(seconds)
        self.clock.attach(self.robot.control_loop.period_ns, self.robot.control_loop.period)
        for judge in self.judges:
            if seconds < judge.period_s:
                judge.repeats_until_s = self.now_s + 3 * judge.period_s

    def close(self) -> None:
        """Give back what the bench has taken, after the shutdown of its robot."""

    @property
    def findings(self) -> list[str]:
        return [finding for judge in self.judges for finding in judge.findings]

    @property
    def now_s(self) -> float:
        return self.clock.now_ns() / NANOSECONDS

    def allow_ramp(self, acceleration: float, seconds: float) -> None:
        """Allow the ramp of a quick stop that is asked for now."""
        for judge in self.judges:
            judge.allow_ramp(acceleration, self.now_s + seconds)

    def restart(self, *, kill: bool) -> None:
        """End robotd and make it anew, on the same drives; ``kill``: without a shutdown."""
        if kill:
            self.clock.detach()
            self.unplug()
            if self.robot.base is not None:
                self.robot.base.close()  # its thread; nothing of it gets to the drives
        else:
            self.robot.shutdown()
        self.robot = self.make_robot()

    def make_robot(self) -> Robot:
        """Return a robot that is not yet started."""
        raise NotImplementedError

    @property
    def driver(self) -> Any:
        """Driver of the robot, without its isolation."""
        return vars(self.robot.connection._driver)["wrapped"]

    def unplug(self) -> None:
        """Take what the present robot has opened from it, as the end of its process does."""

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        """Lose what is sent to (``commands``) and by (``answers``) drives, of all without axes."""

    def delay(self, seconds: float, delay_s: float, axes: Sequence[int] = ()) -> None:
        """Let frames come late for a time."""

    def block(self, seconds: float) -> None:
        """Let the adapter send nothing for a time; what it is given waits in its queue."""

    def cut_cable(self, seconds: float) -> None:
        """Cut the cable at the adapter, and heal it; what the adapter keeps meanwhile it sends."""
        self.block(seconds)

    def reset(self, axis: int) -> None:
        """Switch a drive off and on."""

    def trip(self, axis: int) -> None:
        """Let a drive report a fault."""

    def refuse(self, axis: int) -> None:
        """Let a drive answer "busy" to the next objects that are written or read."""

    def push(self, axis: int, displacement: float) -> None:
        """Let a hand move a joint by ``displacement`` rad, while its servo has little torque."""

    def heal(self) -> None:
        """End all faults."""

    def settle(self) -> None:
        """Let the drives live up to the present."""

    @contextmanager
    def requested(self) -> Iterator[None]:
        """Servos may be switched on in this block."""
        for judge in self.judges:
            judge.may_enable = True
        try:
            yield
        finally:
            for judge in self.judges:
                judge.may_enable = False


def joints(count: int) -> list[dict[str, Any]]:
    return [
        {"name": f"joint{axis + 1}", "axis": axis, "lower_rad": -3.0, "upper_rad": 3.0,
         "velocity_rad_s": VELOCITY, "acceleration_rad_s2": ACCELERATION,
         "rated_torque_nm": RATED_TORQUE, "torque_limit_nm": TORQUE_LIMIT}
        for axis in range(count)
    ]  # fmt: skip


def judges_of(count: int, period_s: float) -> list[Judge]:
    return [
        Judge(f"joint{axis + 1}", VELOCITY, ACCELERATION, period_s, TORQUE_LIMIT, -3.0, 3.0)
        for axis in range(count)
    ]


def knobs_of(**knobs: Any) -> Knobs:
    """Return a fast drive at 0 with a fine encoder, one turn of which is one rad."""
    fine = {"encoder": COUNTS_PER_RAD, "feed": COUNTS_PER_RAD, "step_s": STEP_S}
    return Knobs(**{"power_on_position": 0, "max_speed": 200.0 * COUNTS_PER_RAD, **fine, **knobs})
