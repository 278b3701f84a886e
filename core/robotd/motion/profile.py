"""Trapezoidal velocity profiles: segments of constant acceleration that end exactly at the target.

Units are the axis' own (rad or m) with seconds. A profile starts at any velocity, so that it
can take over a running motion without a jump in position or velocity. Any thread: these are pure
functions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Profile:
    """Speed and ramps of a move or a velocity command.

    In rad/s and rad/s², or m/s and m/s².
    ``velocity`` is a positive speed for a move and signed for a velocity command.
    """

    velocity: float
    acceleration: float
    deceleration: float

    def scaled(self, factor: float) -> Profile:
        """Return the same ramps with ``factor`` times the velocity."""
        return self if factor == 1.0 else replace(self, velocity=self.velocity * factor)


@dataclass(frozen=True, slots=True)
class Segment:
    """Constant acceleration from ``start_s`` after the command to the next segment or for ever."""

    start_s: float
    position: float
    velocity: float
    acceleration: float

    def at(self, elapsed_s: float) -> tuple[float, float]:
        """Position and velocity ``elapsed_s`` after the command (not after ``start_s``)."""
        time_s = elapsed_s - self.start_s
        speed = self.velocity + self.acceleration * time_s
        return self.position + 0.5 * (self.velocity + speed) * time_s, speed


Ramp = tuple[float, float]
"""Duration (s) and acceleration of one segment."""


def profile_to_position(
    position: float, velocity: float, target: float, profile: Profile, max_deceleration: float
) -> list[Segment]:
    """Return the segments from a state to rest at ``target``.

    Too fast to stop in time with the profile's deceleration, the motion brakes harder, up to
    ``max_deceleration``; where that is not enough it runs past the target and comes back.
    """
    side = math.copysign(1.0, target - position)
    ramps = _approach(abs(target - position), side * velocity, profile, max_deceleration)
    segments = _integrate(position, velocity, [(time, side * rate) for time, rate in ramps])
    return [*segments[:-1], Segment(segments[-1].start_s, target, 0.0, 0.0)]


def profile_to_velocity(
    position: float, velocity: float, target: float, acceleration: float, deceleration: float
) -> list[Segment]:
    """Return the segments from a state to the signed velocity ``target``, which is then held.

    ``acceleration`` rules where the speed grows and ``deceleration`` where it shrinks,
    whatever the direction.
    """
    ramps: list[Ramp] = []
    if velocity * target < 0:
        ramps.append((abs(velocity) / deceleration, -math.copysign(deceleration, velocity)))
        velocity_then = 0.0
    else:
        velocity_then = velocity
    change = target - velocity_then
    rate = acceleration if abs(target) > abs(velocity_then) else deceleration
    ramps.append((abs(change) / rate, math.copysign(rate, change)))
    segments = _integrate(position, velocity, ramps)
    last = segments[-1]
    return [*segments[:-1], Segment(last.start_s, last.position, target, 0.0)]


def profile_to_rest(position: float, velocity: float, deceleration: float) -> list[Segment]:
    """Return the segments from a state to rest with ``deceleration``."""
    return profile_to_velocity(position, velocity, 0.0, deceleration, deceleration)


def _approach(distance: float, speed: float, profile: Profile, limit: float) -> list[Ramp]:
    """Return the ramps over ``distance`` ≥ 0 to rest; ``speed`` is positive towards the target."""
    brake = profile.deceleration
    if speed < 0:
        turned = distance + speed * speed / (2 * brake)
        return [(-speed / brake, brake), *_approach(turned, 0.0, profile, limit)]
    stopping = speed * speed / (2 * brake)
    if stopping > distance:
        if distance > 0 and speed * speed <= 2 * distance * limit:
            return [(2 * distance / speed, -speed * speed / (2 * distance))]
        back = _approach(stopping - distance, 0.0, profile, limit)
        return [(speed / brake, -brake), *((time, -rate) for time, rate in back)]
    return _trapezoid(distance, speed, profile)


def _trapezoid(distance: float, speed: float, profile: Profile) -> list[Ramp]:
    """Return the ramps where ``distance`` is enough to stop with the profile's deceleration."""
    gain, brake = profile.acceleration, profile.deceleration
    top = profile.velocity
    if speed > top:
        first = ((speed - top) / brake, -brake)
        covered = (speed * speed - top * top) / (2 * brake)
    else:
        reachable = (distance + speed * speed / (2 * gain)) * 2 * gain * brake / (gain + brake)
        top = max(speed, min(top, math.sqrt(reachable)))
        first = ((top - speed) / gain, gain)
        covered = (top * top - speed * speed) / (2 * gain)
    if top == 0:
        return []
    cruise = max(0.0, distance - covered - top * top / (2 * brake)) / top
    return [first, (cruise, 0.0), (top / brake, -brake)]


def _integrate(position: float, velocity: float, ramps: list[Ramp]) -> list[Segment]:
    """Return the segments of ``ramps``, and one more that starts at their end."""
    segments, start_s = [], 0.0
    for duration, rate in ramps:
        if duration <= 0:
            continue
        segment = Segment(start_s, position, velocity, rate)
        segments.append(segment)
        start_s += duration
        position, velocity = segment.at(start_s)
    return [*segments, Segment(start_s, position, velocity, 0.0)]
