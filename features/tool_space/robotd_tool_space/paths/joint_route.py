"""Route of the joints of an arm: moves of the joints and paths of the tool as one curve.

Between a joint move and its neighbour the corner is rounded in the space of the joints.
Between two curves of the tool that is done in space, see ``tool_path``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.geometry.kinematics import Kinematics
from robotd_tool_space.geometry.rotations import pose_differences
from robotd_tool_space.paths.joint_path import MAX_SAMPLES, MIN_SAMPLES, STEP_M, STEP_RAD, hermite
from robotd_tool_space.paths.tool_curves import ToolSpeed, corner_places
from robotd_tool_space.paths.tool_path import NO_LENGTH_S, Blend

RATE_SAMPLES = 100  # of a motion of the joints, for its highest rates
MAX_TRIES = 20
SHRINK = 0.9  # of a corner that is too wide, beside the ratio to its bound
MIN_RATE = 0.1  # of the full speed of the tool, where it is to keep one speed
CORNER_SAMPLES = 24  # of a corner, at least


class JointCurve(Protocol):
    """Positions of the joints over the parameter s, the time at full speed."""

    @property
    def at_s(self) -> FloatArray:
        """(k,) samples, increasing from 0."""
        ...

    @property
    def rests(self) -> Sequence[int]:
        """Inner samples at which it rests."""
        ...

    @property
    def ends_s(self) -> Sequence[float]:
        """Parameters at the ends of its segments."""
        ...

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and derivatives by s, (m, n) each, at (m,) parameters."""
        ...

    @property
    def positions(self) -> FloatArray:
        """(k, n) of the joints at the samples."""
        ...

    @property
    def slopes(self) -> FloatArray:
        """(k, n) derivatives by s at the samples."""
        ...

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (m, 4, 4) that the tool should have there."""
        ...


@dataclass(frozen=True, eq=False)
class JointLine:
    """Straight motion of all joints together.

    Attributes:
        start: (n,) rad or m.
        displacement: (n,) to the end.
    """

    kinematics: Kinematics
    start: FloatArray
    displacement: FloatArray
    length_s: float
    at_s: FloatArray
    rests: tuple[int, ...] = ()

    @classmethod
    def to(
        cls,
        kinematics: Kinematics,
        start: FloatArray,
        end: FloatArray,
        velocity: FloatArray,
        speed: ToolSpeed,
    ) -> JointLine:
        """Return the motion between two positions (n,); its length is 0 where they are the same.

        ``velocity``: (n,) of the joints at full speed, which the tool at ``speed`` may lower.
        """
        displacement = end - start
        poses = kinematics.forward(
            start + np.linspace(0.0, 1.0, RATE_SAMPLES + 1)[:, None] * displacement
        )
        steps = pose_differences(poses[:-1], poses[1:]).reshape(-1, 2, 3)
        linear, angular = RATE_SAMPLES * np.linalg.norm(steps, axis=2).max(axis=0)
        length_s = max(
            speed.time_s(linear, angular), float((np.abs(displacement) / velocity).max())
        )
        needed = max(linear / STEP_M, angular / STEP_RAD, np.abs(displacement).max() / STEP_RAD)
        count = int(np.clip(np.ceil(needed), MIN_SAMPLES, MAX_SAMPLES))
        return cls(kinematics, start, displacement, length_s, np.linspace(0.0, length_s, count + 1))

    @property
    def ends_s(self) -> tuple[float]:
        return (self.length_s,)

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        slope = self.displacement / self.length_s
        return self.start + at_s[:, None] * slope, np.tile(slope, (len(at_s), 1))

    @cached_property
    def positions(self) -> FloatArray:
        return self.exact(self.at_s)[0]

    @cached_property
    def slopes(self) -> FloatArray:
        return self.exact(self.at_s)[1]

    def poses(self, at_s: FloatArray) -> FloatArray:
        return self.kinematics.forward(self.exact(at_s)[0])


@dataclass(frozen=True, eq=False)
class JointCorner:
    """Corner between two curves in the space of the joints; see ``CornerCurve``."""

    kinematics: Kinematics
    before: JointCurve
    after: JointCurve
    reach_s: float
    rests: tuple[int, ...] = ()
    ends_s: tuple[float, ...] = ()

    @property
    def at_s(self) -> FloatArray:
        before_s = self.before.at_s[-1] - self.reach_s
        count = int((self.before.at_s > before_s).sum() + (self.after.at_s < self.reach_s).sum())
        return np.linspace(0.0, 2.0 * self.reach_s, max(count, CORNER_SAMPLES) + 1)

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        part = (at_s / (2.0 * self.reach_s))[:, None]
        first_s, second_s = corner_places(at_s, self.before.at_s[-1], self.reach_s)
        first, leave = self.before.exact(first_s)
        second, arrive = self.after.exact(second_s)
        corner, _ = self.after.exact(np.zeros(1))
        return first + second - corner, (1.0 - part) * leave + part * arrive

    @cached_property
    def positions(self) -> FloatArray:
        return self.exact(self.at_s)[0]

    @cached_property
    def slopes(self) -> FloatArray:
        return self.exact(self.at_s)[1]

    def poses(self, at_s: FloatArray) -> FloatArray:
        return self.kinematics.forward(self.exact(at_s)[0])

    def bounded(self, blend: Blend) -> JointCorner | None:
        """Return the widest corner found that stays within ``blend`` of its pose; None: none."""
        corner, (pose,) = self, self.after.poses(np.zeros(1))
        bounds = np.array([blend.linear, blend.angular])
        for _ in range(MAX_TRIES):
            if corner.reach_s <= NO_LENGTH_S:
                return None
            poses = corner.poses(corner.at_s)
            off = pose_differences(np.tile(pose, (len(poses), 1, 1)), poses)
            away = np.linalg.norm(off.reshape(-1, 2, 3), axis=2).max(axis=0)
            excess = float((away / np.maximum(bounds, 1e-9)).max())
            if excess <= 1.0:
                return corner
            reach_s = corner.reach_s * max(SHRINK / excess, 0.1)
            corner = JointCorner(self.kinematics, self.before, self.after, reach_s)
        return None


@dataclass(frozen=True, eq=False)
class Route:
    """Curves of the joints, one after the other.

    Attributes:
        at_s: (k,) samples, increasing.
        positions, slopes: (k, n), derivatives by s; at a stop those after it.
        rests: inner samples at which the joints rest.
        ends_s: s at the end of each segment: in the middle of its corner.
    """

    at_s: FloatArray
    positions: FloatArray
    slopes: FloatArray
    rests: tuple[int, ...]
    ends_s: tuple[float, ...]
    parts: tuple[tuple[JointCurve, float], ...]  # with the parameter at which each begins
    edges_s: FloatArray  # (parts + 1,)

    @classmethod
    def of(
        cls, kinematics: Kinematics, curves: Sequence[JointCurve], blends: Sequence[Blend]
    ) -> Route:
        """Return the route along curves, each of which begins where the one before ends.

        ``blends``: between each two curves.
        """
        corners: list[JointCorner | None] = []
        for pair, blend in zip(pairwise(curves), blends, strict=True):
            half_s = 0.5 * min(_last_s(pair[0]), pair[1].ends_s[0])
            asked = min(blend.linear, blend.angular) > 0.0
            corner = JointCorner(kinematics, *pair, half_s)
            corners.append(corner.bounded(blend) if asked else None)
        spans: list[tuple[JointCurve, float, float]] = []
        stops = []
        for number, curve in enumerate(curves):
            before = corners[number - 1] if number else None
            following = corners[number] if number < len(corners) else None
            begin_s = before.reach_s if before else 0.0
            end_s = float(curve.at_s[-1]) - (following.reach_s if following else 0.0)
            if end_s - begin_s > NO_LENGTH_S:
                spans.append((curve, begin_s, end_s))
            if following:
                spans.append((following, 0.0, 2.0 * following.reach_s))
            elif number < len(corners):
                stops.append(len(spans) - 1)
        return cls._joined(spans, stops, _ends_s(curves))

    @classmethod
    def _joined(
        cls,
        spans: Sequence[tuple[JointCurve, float, float]],
        stops: Sequence[int],
        ends_s: tuple[float, ...],
    ) -> Route:
        edges_s = np.cumsum([0.0, *(end_s - begin_s for _, begin_s, end_s in spans)])
        at_s, positions, slopes, rests, count = [], [], [], [], 0
        for number, (curve, begin_s, end_s) in enumerate(spans):
            inner = (curve.at_s > begin_s + NO_LENGTH_S) & (curve.at_s < end_s - NO_LENGTH_S)
            inner[0] |= begin_s == 0.0
            places = curve.at_s[inner]
            found = curve.positions[inner], curve.slopes[inner]
            if begin_s > 0.0:
                places = np.concatenate([[begin_s], places])
                begin = curve.exact(np.array([begin_s]))
                found = np.vstack([begin[0], found[0]]), np.vstack([begin[1], found[1]])
            first = int(np.argmax(inner)) - (begin_s > 0.0)
            rests += [count + rest - first for rest in curve.rests if inner[rest]]
            at_s.append(edges_s[number] + places - begin_s)
            positions.append(found[0])
            slopes.append(found[1])
            count += len(places)
            if number in stops:
                rests.append(count)
        curve, _, end_s = spans[-1]
        last = curve.exact(np.array([end_s]))
        return cls(
            np.concatenate([*at_s, edges_s[-1:]]),
            np.vstack([*positions, last[0]]),
            np.vstack([*slopes, last[1]]),
            tuple(rests),
            ends_s,
            tuple((curve, begin_s) for curve, begin_s, _ in spans),
            edges_s,
        )

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and derivatives by s, (m, n) each, at (m,) parameters."""
        positions = np.empty((len(at_s), self.positions.shape[1]))
        slopes = np.empty_like(positions)
        for inside, curve, places in self._split(at_s):
            positions[inside], slopes[inside] = curve.exact(places)
        return positions, slopes

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (m, 4, 4) that the tool should have at (m,) parameters."""
        result = np.empty((len(at_s), 4, 4))
        for inside, curve, places in self._split(at_s):
            result[inside] = curve.poses(places)
        return result

    def _split(self, at_s: FloatArray) -> list[tuple[FloatArray, JointCurve, FloatArray]]:
        index = np.clip(np.searchsorted(self.edges_s, at_s, "right") - 1, 0, len(self.parts) - 1)
        found = []
        for number in np.unique(index).tolist():
            inside = index == number
            curve, begin_s = self.parts[number]
            found.append((inside, curve, at_s[inside] - self.edges_s[number] + begin_s))
        return found


@dataclass(frozen=True, eq=False)
class EvenRoute:
    """Route whose parameter passes as the distance of the tool does: one speed at constant rate.

    Attributes:
        route: what it leads along.
        at_s: (k,) parameters of the samples of ``route``: the distance divided by the speed.
        stretch: (k,) derivatives of the parameter of ``route`` by that.
    """

    route: Route
    at_s: FloatArray
    stretch: FloatArray

    @classmethod
    def of(cls, route: Route, kinematics: Kinematics, velocity: float) -> EvenRoute:
        """Return the route for a tool at ``velocity``, m/s.

        Raises InvalidArgument: somewhere the tool turns, or turns back, and does not advance.
        """
        _, jacobian = kinematics.chain.forward_and_jacobian(route.positions)
        rates = np.linalg.norm((jacobian[:, :3] @ route.slopes[..., None])[..., 0], axis=1)
        slowest = int(rates.argmin())
        if rates[slowest] < MIN_RATE * velocity:
            place = 100.0 * route.at_s[slowest] / route.at_s[-1]
            raise InvalidArgument(
                f"at {place:.0f} % the tool cannot keep a constant speed: it turns back there, or"
                " turns in place"
            )
        distances = np.diff(route.at_s) * 0.5 * (rates[1:] + rates[:-1])
        at_s = np.concatenate([[0.0], np.cumsum(distances)]) / velocity
        return cls(route, at_s, velocity / rates)

    @property
    def positions(self) -> FloatArray:
        return self.route.positions

    @property
    def slopes(self) -> FloatArray:
        return self.route.slopes * self.stretch[:, None]

    @property
    def rests(self) -> tuple[int, ...]:
        return self.route.rests

    @property
    def ends_s(self) -> tuple[float, ...]:
        return tuple(np.interp(self.route.ends_s, self.route.at_s, self.at_s).tolist())

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and derivatives by the parameter, (m, n) each, at (m,) parameters."""
        positions, slopes = self.route.exact(self._on_route(at_s))
        return positions, slopes * np.interp(at_s, self.at_s, self.stretch)[:, None]

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (m, 4, 4) that the tool should have at (m,) parameters."""
        return self.route.poses(self._on_route(at_s))

    def _on_route(self, at_s: FloatArray) -> FloatArray:
        index = np.clip(np.searchsorted(self.at_s, at_s, "right") - 1, 0, len(self.at_s) - 2)
        width = self.at_s[index + 1] - self.at_s[index]
        part = (at_s - self.at_s[index]) / width
        first, last = self.route.at_s[index], self.route.at_s[index + 1]
        leave, arrive = self.stretch[index], self.stretch[index + 1]
        found = hermite(part, first, last, width * leave, width * arrive)
        return np.clip(found, 0.0, self.route.at_s[-1])


def _last_s(curve: JointCurve) -> float:
    """Return the length of the last segment of a curve."""
    return float(np.diff([0.0, *curve.ends_s])[-1])


def _ends_s(curves: Sequence[JointCurve]) -> tuple[float, ...]:
    begins = np.cumsum([0.0, *(curve.at_s[-1] for curve in curves)])
    return tuple(
        float(begin_s + end_s)
        for begin_s, curve in zip(begins, curves, strict=False)
        for end_s in curve.ends_s
    )
