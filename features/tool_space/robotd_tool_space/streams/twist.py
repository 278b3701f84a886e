"""Tool velocity as a stream that keeps its direction and the limits of the joints.

Each period has one factor s, 0 to 1, of the commanded twist V, the largest for which, with the
joint velocities b = J⁺V,

- every |s·b| keeps the velocity limit,
- every joint can brake before its position limit,
- s²·|db/dt| keeps the acceleration limit: what the change of J takes on the way,
- links and tool keep a limit of their speed, and
- the tool slows down while the smallest singular value of J shrinks.

s itself has a limited rate and acceleration, as J⁺V amplifies its changes. Integration drifts from
the path by the square of the period; the difference between the pose and the integral of s·V is
fed back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robotd.api import FloatArray
from robotd.api.robots import JointLimits, MotionLimits
from robotd_tool_space.frames.followed_frame import FollowedFrame, FrameMotion
from robotd_tool_space.geometry.differential import Differential, Rates
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import (
    moved_pose,
    pose_differences,
    rotation_matrices,
    turned_twist,
)
from robotd_tool_space.streams.servo_status import ServoCode, ServoStatus
from robotd_tool_space.streams.tool_twist_limits import FactorRamp, ToolTwistLimits, TwistRamp

SLOW_AT, STOP_AT = 0.25, 0.07  # singular values at which the tool slows down, and stops
HALT_TIME_S = 0.02  # s below which the tool is at rest
MAX_MISSING_SHARE = 0.02  # share of a twist that the arm cannot give; above it the tool stops
LOOK_S, LOOK_RAD = 0.01, 0.02  # distance ahead on which changes are measured, at most
VELOCITY_SHARE = 0.85  # of the limits; the drift takes the rest of what can be tracked
SPEED_SHARE = 0.97  # of a limit of the arm's speed, likewise
RAMP_SHARE, PATH_SHARE, TOTAL_SHARE = 0.3, 0.4, 0.6  # of the acceleration limits
STOP_SHARE = 0.5  # of them, with the path's share, while the tool slows to rest
FACTOR_JERK_SHARE = 0.6  # of the jerk limits
BRAKE_SHARE, BRAKE_S = 0.4, 0.06  # of the acceleration, at position limits; time of the last part
STOP_STEPS = 2  # of Newton's iteration, to the joints where a stop ends
STOP_DISTANCE_SHARE = 1.1  # of its distance as planned with the present s, which may rise on it
MARGIN_RAD = 1e-3  # to the position limits, rad or m
STANDING_RAD_S = 1e-5  # below it, a joint is not moved: the margin lasts for more than a minute
LEAST_RATE, MAX_RATE, LEAST_CHANGE, MAX_CHANGE = 0.2, 20.0, 60.0, 200.0  # of s: 1/s, 1/s²
DRIFT_GAIN = 12.0  # 1/s
FULL_GAIN_AT = 0.02  # m/s or rad/s of the tool above which the drift is fully fed back
POSE_BRAKE_SHARE, POSE_BRAKE_S = 0.35, 0.25  # as BRAKE, of the tool before a target
ARRIVED_M, ARRIVED_RAD = 2e-6, 1e-5


@dataclass(frozen=True, eq=False)
class ToolTwist:
    """Velocity of the tool, in m/s and rad/s of its origin.

    Attributes:
        twist: (6,) linear and angular.
        in_tool: in the axes of the tool; False: of the base.
        frame: that carries the tool, and in whose axes and to which the velocity is; None: none.
    """

    twist: FloatArray
    in_tool: bool = False
    frame: FollowedFrame | None = None

    @property
    def moves(self) -> bool:
        """The tool moves, or may do so as it is carried."""
        return self.frame is not None or bool(self.twist.any())


@dataclass(frozen=True, eq=False)
class PoseCommand:
    """Pose to go to, on a straight line until the next command.

    Attributes:
        pose: (4, 4) of the tool in ``frame``.
        frame: that carries the tool; None: the base.
    """

    pose: FloatArray
    frame: FollowedFrame | None = None
    moves = True


Command = ToolTwist | PoseCommand
UNMOVED = FrameMotion(np.eye(4), np.zeros(6))  # the base


class TwistStage:
    """``MovingReference`` that moves the tool of a joint group by twists and to poses.

    Args:
        kinematics: returns those of the group with the chosen tool; asked at each start.
        motion_limits: of the joint group.
        limits: of the tool; None: the default ones.

    Attributes:
        status: of the last period; immutable, any thread may read it.
        pose: (4, 4) that the tool is commanded to, by integration; any thread may read it.
    """

    def __init__(
        self,
        kinematics: Callable[[], Kinematics],
        motion_limits: MotionLimits,
        limits: ToolTwistLimits | None = None,
    ) -> None:
        self.status = ServoStatus()
        self.pose = np.eye(4)
        self._chosen = kinematics
        self._limits = limits or ToolTwistLimits()
        self._motion_limits = motion_limits
        self._command: Command | None = None
        self._obstacle = ""  # before which the last command was ended

    def begin(self, setpoint: FloatArray, limits: JointLimits, period_s: float) -> None:
        """Start from a setpoint; the tool goes on with its velocity and slows down."""
        kinematics = self._chosen()
        self._chain, self._differential = kinematics.chain, Differential(kinematics)
        self._joints, self._period_s = limits, period_s
        self._setpoint = setpoint.copy()
        self._ramp = TwistRamp(self._limits, period_s)
        self._factor = FactorRamp(period_s)
        poses, jacobians = self._chain.forward_and_jacobian(setpoint[:1])
        self.pose, (jacobian,) = poses[0], jacobians
        moving = jacobian @ setpoint[1]
        if np.abs(moving).max() > 1e-6:
            self._ramp.turn(moving, jacobian @ setpoint[2])
        (self._rates,) = self._differential.of_jacobians(poses, jacobians, moving)
        self._in_tool = False
        self._lower = limits.lower + MARGIN_RAD
        self._upper = limits.upper - MARGIN_RAD
        self._obstacle = ""
        self.stop()

    def take(self, command: Command) -> None:
        """Follow a command from the next period on."""
        self._command = command

    def stop(self) -> None:
        """Slow to rest, in the direction of motion."""
        self._command = None
        self._go(np.zeros(6))

    def advance(self) -> FloatArray:
        """Return the next setpoint (3, n)."""
        start, in_tool = self._ramp.state, self._in_tool
        if (command := self._command) is not None:
            self._obey(command)
        position, velocity, _ = self._setpoint
        dt = self._period_s
        before = self._factor.factor * self._twist_in_base(self._ramp.twist)
        twist = self._twist_in_base(self._ramp.advance())
        if not twist.any() and not before.any():
            return self._stand()
        # J is used where the joints are at the end of the period, and a little further.
        ahead = position + dt * velocity
        seconds = min(LOOK_S, LOOK_RAD / max(float(np.abs(self._rates.velocity).max()), 1e-9))
        further = ahead + seconds * self._rates.velocity
        (pose, _), (rates, next_rates) = self._differential.at(np.stack([ahead, further]), twist)
        change = (next_rates.velocity - rates.velocity) / seconds
        factor = self._next_factor(ahead, rates, next_rates.singularity, change, seconds)
        self._rates = rates
        if self._stops:
            self._ramp.stop_harder(self._strongest_stop(rates.velocity, change))
        if self._meets_obstacle(position, rates, factor):
            # As before: a client that goes on must not make the stop longer.
            self._ramp.resume(start)
            self._in_tool = in_tool
            self.stop()
            twist = self._twist_in_base(self._ramp.advance())
            factor = self._factor.factor
        now = factor * twist
        self.pose = moved_pose(self.pose, 0.5 * dt * (before + now))
        following = rates.inverse @ now
        if rates.missing <= MAX_MISSING_SHARE:
            moving = float(np.linalg.norm(now)) / FULL_GAIN_AT
            drift = _small_difference(pose, self.pose)
            following += DRIFT_GAIN * min(1.0, moving) * (rates.inverse @ drift)
        return self._integrate(following)

    @property
    def _stops(self) -> bool:
        return not self._ramp.target.any()

    def _stand(self) -> FloatArray:
        """Return the setpoint of a tool that has no velocity."""
        if self._command is not None:  # it asks for none
            self._obstacle = ""
        self._factor.set(1.0)
        if self._setpoint[1].any():  # the last of the drift
            return self._integrate(np.zeros(len(self._joints.names)))
        self._setpoint[2] = 0.0
        self.pose = self._chain.forward(self._setpoint[0])
        self.status = self._with_obstacle(ServoStatus())
        return self._setpoint.copy()

    def _integrate(self, velocity: FloatArray) -> FloatArray:
        """Return the setpoint with ``velocity`` at the end of the period."""
        dt, (position, before, _) = self._period_s, self._setpoint
        self._setpoint = np.array(
            [position + 0.5 * dt * (before + velocity), velocity, (velocity - before) / dt]
        )
        return self._setpoint.copy()

    def _strongest_stop(self, velocity: FloatArray, change: FloatArray) -> float:
        """Return the highest share of the twist that may go in a second of a stop, 1/s.

        ``velocity`` and its ``change`` (n,) in a second are those of s = 1.
        """
        s, speed = self._factor.factor, np.maximum(np.abs(velocity), 1e-9)
        # What the motion itself takes from a joint's speed counts; what it adds ends with the stop.
        slows = np.minimum(np.sign(velocity) * s * s * change, 0.0)
        left = np.maximum(STOP_SHARE * self._joints.acceleration + slows, 0.0)
        return _lowest(left / np.maximum(s * speed, 1e-9))[0]

    def _next_factor(
        self,
        at: FloatArray,
        rates: Rates,
        next_singularity: float,
        change: FloatArray,
        seconds: float,
    ) -> float:
        """Return s at the end of the period, and note the status.

        ``next_singularity`` is that after ``seconds`` with s = 1, and ``change`` (n,) that of the
        joints' velocities in a second.
        """
        limits, acceleration = self._joints, self._joints.acceleration
        speed = np.maximum(np.abs(rates.velocity), 1e-9)
        slope = (next_singularity - rates.singularity) / seconds
        bounds = {
            "velocity": _lowest(VELOCITY_SHARE * limits.velocity / speed),
            "acceleration": _root(PATH_SHARE * acceleration / np.maximum(np.abs(change), 1e-9)),
            "limit": _lowest(self._braking(at, rates.velocity) / speed),
            "singularity": _slow_down(rates.singularity, slope),
        }
        if (factors := self._motion_limits.factors) is not None:
            bounds["speed"] = SPEED_SHARE * float(factors(at[None], rates.velocity[None])[0]), -1
        if rates.missing > MAX_MISSING_SHARE:
            bounds["singularity"] = 0.0, -1
        s = self._factor.factor
        # The bounds rise while the twist falls: a stop has no use for that.
        highest = min(s if self._stops else 1.0, *(bound for bound, _ in bounds.values()))
        # s'·b + s²·db/dt + s·J⁺·dV/dt, each joint's acceleration, bounds s'.
        ramp = rates.inverse @ self._twist_in_base(self._ramp.acceleration)
        others = np.sign(rates.velocity) * (s * s * change + s * ramp)
        rate_limits = (
            max(
                -MAX_RATE,
                min(float(((-TOTAL_SHARE * acceleration - others) / speed).max()), -LEAST_RATE),
            ),
            min(
                MAX_RATE,
                max(float(((TOTAL_SHARE * acceleration - others) / speed).min()), LEAST_RATE),
            ),
        )
        strongest = float((FACTOR_JERK_SHARE * limits.jerk / speed).min())
        strongest = min(max(strongest, LEAST_CHANGE), MAX_CHANGE)
        factor = self._factor.advance(highest, *rate_limits, strongest)
        self.status = self._with_obstacle(self._status(rates, bounds, factor, leaves=slope > 0.0))
        return factor

    def _meets_obstacle(self, at: FloatArray, rates: Rates, factor: float) -> bool:
        """Return True, and note the obstacle, where the path of a stop of the command meets one.

        ``at`` (n,) are the positions at the start of the period, at ``self.pose``.
        """
        obstacle = self._motion_limits.obstacle
        if obstacle is None or self._command is None or not self._ramp.target.any():
            return False  # it stops anyway
        twist = self._ramp.twist
        velocity = factor * np.abs(rates.inverse @ self._twist_in_base(twist))
        displacement = (
            self._ramp.stop_displacement(self._strongest(velocity)) + self._period_s * twist
        )
        in_base = STOP_DISTANCE_SHARE * factor * self._twist_in_base(displacement)
        # The joints bend while the tool goes straight: steps of Newton's from where they lead.
        stopped = at + rates.inverse @ in_base
        pose = moved_pose(self.pose, self._curved(in_base))
        for _ in range(STOP_STEPS):
            stopped += rates.inverse @ pose_differences(self._chain.forward(stopped), pose)
        self._obstacle = obstacle(at, stopped)
        return bool(self._obstacle)

    def _with_obstacle(self, status: ServoStatus) -> ServoStatus:
        if not self._obstacle:
            return status
        return ServoStatus(ServoCode.HALT_FOR_COLLISION, status.factor, self._obstacle)

    def _braking(self, at: FloatArray, velocity: FloatArray) -> FloatArray:
        """Return the speeds (n,) from which joints stop before their position limits.

        Infinite for joints that stand: rounding gives them a velocity, perhaps to a limit that
        they are at.
        """
        distance = np.where(velocity > 0.0, self._upper - at, at - self._lower)
        strong = BRAKE_SHARE * self._joints.acceleration
        speeds = _braking_speed(np.maximum(distance, 0.0), strong, BRAKE_S)
        return np.where(np.abs(velocity) > STANDING_RAD_S, speeds, np.inf)

    def _status(
        self, rates: Rates, bounds: dict[str, tuple[float, int]], factor: float, *, leaves: bool
    ) -> ServoStatus:
        """Return the status by what limits the factor."""
        what, (lowest, joint) = min(bounds.items(), key=lambda bound: bound[1][0])
        if lowest > 0.99:
            return ServoStatus(factor=factor)
        if what == "speed":
            return ServoStatus(factor=factor, text=self._motion_limits.reason)
        name = self._joints.names[joint]
        if what == "singularity":
            return _halted(rates) if lowest < HALT_TIME_S else _approaching(rates, factor)
        if what == "limit":
            state = "is at" if lowest < HALT_TIME_S else "brakes before"
            return ServoStatus(ServoCode.JOINT_BOUND, factor, f"{name} {state} its position limit")
        text = f"{name} would exceed its {what} limit"
        if rates.singularity < SLOW_AT and leaves:
            return ServoStatus(ServoCode.DECELERATE_FOR_LEAVING_SINGULARITY, factor, text)
        return ServoStatus(ServoCode.NO_WARNING, factor, text)

    def _obey(self, command: Command) -> None:
        """Let the ramp lead to what the command asks for now."""
        motion = UNMOVED if command.frame is None else command.frame.motion()
        if motion is None:  # it is not followed any more
            self.stop()
            return
        if isinstance(command, ToolTwist):
            self._change_frame(command.in_tool)
            twist = command.twist
            if command.frame is not None:
                twist = turned_twist(motion.pose[:3, :3], twist)
        else:
            self._change_frame(in_tool=False)
            twist = self._towards(motion.pose @ command.pose)
        if command.frame is not None:
            twist = twist + motion.twist_at(self.pose[:3, 3])
        self._go(self._limits.slowed(twist))

    def _go(self, target: FloatArray) -> None:
        """Let the ramp lead to ``target``, no faster than the joints can."""
        if np.array_equal(target, self._ramp.target):
            return
        if not target.any() and self._motion_limits.factors is not None:
            self._take_factor()
        inverse = self._rates.inverse
        speeds = np.abs(inverse @ self._twist_in_base(target))
        then, _ = _lowest(self._joints.velocity / np.maximum(speeds, 1e-9))
        # s on the way: a stop begins with the present one, a turn away from a singularity ends it.
        factor = min(1.0, then) if target.any() else self._factor.factor
        change = factor * np.abs(inverse @ self._twist_in_base(target - self._ramp.twist))
        self._ramp.go(target, self._strongest(change))

    def _strongest(self, change: FloatArray) -> float:
        """Return the highest share of a change of the joints' velocities (n,) in a second, 1/s."""
        return _lowest(RAMP_SHARE * self._joints.acceleration / np.maximum(change, 1e-9))[0]

    def _take_factor(self) -> None:
        """Make s a part of the ramped twist, which would otherwise fall before the tool slows."""
        factor, ramp = self._factor, self._ramp
        acceleration = factor.factor * ramp.acceleration + factor.rate * ramp.twist
        ramp.turn(factor.factor * ramp.twist, acceleration)
        factor.set(1.0)

    def _towards(self, target: FloatArray) -> FloatArray:
        """Return the twist to a pose: linear and angular part arrive together."""
        displacement = pose_differences(self.pose, target)
        limits = self._limits
        linear, angular = (
            float(np.linalg.norm(displacement[:3])),
            float(np.linalg.norm(displacement[3:])),
        )
        if linear < ARRIVED_M and angular < ARRIVED_RAD:
            return np.zeros(6)
        rates = [
            _pose_rate(linear, limits.linear_m_s, limits.linear_m_s2),
            _pose_rate(angular, limits.angular_rad_s, limits.angular_rad_s2),
        ]
        toward: FloatArray = displacement * min(rates)
        return toward

    def _twist_in_base(self, twist: FloatArray) -> FloatArray:
        return turned_twist(self.pose[:3, :3], twist) if self._in_tool else twist

    def _curved(self, displacement: FloatArray) -> FloatArray:
        """Return the displacement (6,) of the present twist, which turns with the tool's axes."""
        if not (self._in_tool and displacement[3:].any()):
            return displacement
        return np.concatenate(
            [rotation_matrices(0.5 * displacement[3:]) @ displacement[:3], displacement[3:]]
        )

    def _change_frame(self, in_tool: bool) -> None:
        """Express the present twist in the other frame."""
        if in_tool == self._in_tool:
            return
        rotation = self.pose[:3, :3].T if in_tool else self.pose[:3, :3]
        twist, acceleration = self._ramp.twist, self._ramp.acceleration
        self._ramp.turn(turned_twist(rotation, twist), turned_twist(rotation, acceleration))
        self._in_tool = in_tool


def _braking_speed(distance: FloatArray, strong: FloatArray, seconds: float) -> FloatArray:
    """Return the speeds that stop within ``distance`` d: √(2·a·d), and d / seconds near its end.

    The deceleration is at most ``strong`` and fades before the end, so that its jerk is limited.
    """
    first = strong * seconds
    speeds: FloatArray = first * (np.sqrt(1.0 + 2.0 * distance / (first * seconds)) - 1.0)
    return speeds


def _pose_rate(distance: float, fastest: float, strongest: float) -> float:
    """Return speed / distance on the way to a target."""
    strong = np.array(POSE_BRAKE_SHARE * strongest)
    if distance < 1e-12:
        return 1.0 / POSE_BRAKE_S
    speed = float(_braking_speed(np.array(distance), strong, POSE_BRAKE_S))
    return min(speed, fastest) / distance


def _slow_down(singularity: float, slope: float) -> tuple[float, int]:
    """Return s by the smallest singular value and its rate at s = 1, 1/s."""
    share = min(max((singularity - STOP_AT) / (SLOW_AT - STOP_AT), 0.0), 1.0)
    slowed = float(np.sin(0.5 * np.pi * share))  # begins without a step of the rate
    shrinks = min(max(-slope / 0.02, 0.0), 1.0)
    return 1.0 - shrinks * (1.0 - slowed), -1


def _lowest(values: FloatArray) -> tuple[float, int]:
    """Return the lowest value, and of which joint it is."""
    joint = int(values.argmin())
    return float(values[joint]), joint


def _root(values: FloatArray) -> tuple[float, int]:
    lowest, joint = _lowest(values)
    return math.sqrt(lowest), joint


def _small_difference(pose: FloatArray, target: FloatArray) -> FloatArray:
    """Return ``pose_differences`` (6,) of poses that are less than 0.1 rad apart."""
    turn = target[:3, :3] @ pose[:3, :3].T
    return np.array(
        [
            *(target[:3, 3] - pose[:3, 3]),
            0.5 * (turn[2, 1] - turn[1, 2]),
            0.5 * (turn[0, 2] - turn[2, 0]),
            0.5 * (turn[1, 0] - turn[0, 1]),
        ]
    )


def _halted(rates: Rates) -> ServoStatus:
    if rates.missing > MAX_MISSING_SHARE:
        text = "singular: no joint moves the tool in this direction from here"
    else:
        text = f"singular ({rates.singularity:.2f}): the tool stops in this direction"
    return ServoStatus(ServoCode.HALT_FOR_SINGULARITY, 0.0, text)


def _approaching(rates: Rates, factor: float) -> ServoStatus:
    text = f"the tool slows down before a singularity ({rates.singularity:.2f})"
    return ServoStatus(ServoCode.DECELERATE_FOR_APPROACHING_SINGULARITY, factor, text)
