"""Kinematics of a joint group: forward, inverse, and the reason where there is no inverse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np

from robotd.api import (
    BoolArray,
    FloatArray,
    InvalidArgument,
    RobotDescriptor,
    Unsupported,
    UrdfRobot,
    read_urdf,
)
from robotd.api.robots import JointLimits, axis_limits, joint_limits, tool_link
from robotd_tool_space.geometry.chain import Chain
from robotd_tool_space.geometry.pose_solver import PoseProblem, Task, pose_weights
from robotd_tool_space.geometry.rotations import checked_pose, pose_differences

RANDOM_STARTS = 16  # random ones in addition to the seed, solved at once
MAX_ROUNDS = 12  # of random starts at most
MANY_STARTS = 128  # for all solutions
SAME_RAD = 1e-3  # distance of two positions that are one solution, rad or m
OUTSIDE_RAD = 1e-9  # beyond a limit that is rounding
TURN = 2.0 * np.pi


class UnreachableCause(Enum):
    """Reason why a pose or a line cannot be reached."""

    OUT_OF_REACH = "out of reach"
    ORIENTATION = "orientation"
    LIMITS = "limits"
    SINGULAR = "singular"


class Unreachable(InvalidArgument):
    """A pose or line that the arm cannot reach; the text says why.

    Attributes:
        cause: kind of the reason.
        place: where on a line, 0 to 1; None: not on a line.
    """

    def __init__(self, cause: UnreachableCause, reason: str, place: float | None = None) -> None:
        super().__init__(reason if place is None else f"at {100.0 * place:.0f} % {reason}")
        self.cause, self.text, self.place = cause, reason, place


@dataclass(frozen=True, eq=False)
class Kinematics:
    """Kinematics of a joint group with a tool. Immutable; any thread may call.

    Positions are of ``chain.names``, rad or m, shape (n,) and where stated (..., n). Poses are of
    the tool in ``chain.base``, shape (4, 4), m.

    Attributes:
        chain: joints between base and tool.
        lower, upper: (n,) position limits; -inf and inf for a joint without.
        velocity: (n,) speed limits; the nearest solution is the one that takes the shortest time.
        units: "rad" or "m" of each joint.
    """

    chain: Chain
    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    units: tuple[str, ...]

    @classmethod
    def of_urdf(
        cls,
        urdf: UrdfRobot,
        names: Sequence[str],
        link: str,
        others: Sequence[str] = (),
    ) -> Kinematics:
        """Return the kinematics of joints with the limits of the URDF. Raises DescriptorError."""
        chain = Chain.of_urdf(urdf, names, link, others)
        joints = [urdf.joint[name] for name in names]
        return cls(
            chain,
            np.array([joint.lower for joint in joints]),
            np.array([joint.upper for joint in joints]),
            np.array([joint.velocity or 1.0 for joint in joints]),
            tuple("m" if joint.type == "prismatic" else "rad" for joint in joints),
        )

    @classmethod
    def of_descriptor(
        cls, descriptor: RobotDescriptor, group: str, limits: JointLimits | None = None
    ) -> Kinematics:
        """Return the kinematics of a joint group.

        Args:
            descriptor: of the robot.
            group: name of the group; ``ALL_JOINTS`` where there are none.
            limits: in force, of a running robot; None: those of the descriptor.

        Raises Unsupported: the robot has no URDF; DescriptorError: the URDF has no such chain.
        """
        if descriptor.urdf is None:
            raise Unsupported(f"the tool of {descriptor.name}, which has no urdf")
        urdf, joints = read_urdf(descriptor.urdf), descriptor.joint_groups[group]
        names = [joint.name for joint in joints]
        others = [name for name in descriptor.joint_names if name not in names]
        source = limits or joint_limits(joints, axis_limits(descriptor))
        return cls(
            Chain.of_urdf(urdf, names, tool_link(urdf, descriptor, group), others),
            source.lower,
            source.upper,
            source.velocity,
            source.units,
        )

    def with_tool(self, offset: FloatArray) -> Kinematics:
        """Return the kinematics of a tool at ``offset`` (4, 4) from the link."""
        return replace(self, chain=self.chain.with_tool(checked_pose(offset, "tool")))

    @cached_property
    def task(self) -> Task:
        """Components of a pose that the arm can choose."""
        return Task.of(self.chain, self.lower, self.upper)

    @cached_property
    def length_m(self) -> float:
        """Length whose error weighs as much as one radian."""
        frames = self.chain.constant[1:, :3, 3]
        links = float(np.linalg.norm(frames, axis=1).sum() + np.linalg.norm(self.chain.end[:3, 3]))
        return min(max(links / 3.0, 0.05), 1.0)

    @cached_property
    def weights(self) -> FloatArray:
        """Weights (6,) of a pose's difference, see ``length_m``."""
        return pose_weights(self.length_m)

    @cached_property
    def joint_lengths(self) -> FloatArray:
        """(n,) what counts as one radian: ``length_m`` where a joint slides, 1 otherwise."""
        return np.where([unit == "m" for unit in self.units], self.length_m, 1.0)

    @property
    def rank(self) -> int:
        """Directions of the task that the joints span where the arm is not singular."""
        return min(len(self.task.chosen) + 2 * self.task.about_axis, len(self.chain.names))

    def forward(self, positions: FloatArray) -> FloatArray:
        """Return the pose of the tool; (..., 4, 4) of positions (..., n)."""
        return self.chain.forward(positions)

    def jacobian(self, positions: FloatArray) -> FloatArray:
        """Return the geometric Jacobian in the base (..., 6, n), at the tool's origin."""
        return self.chain.forward_and_jacobian(positions)[1]

    def inverse(self, target: FloatArray, seed: FloatArray) -> FloatArray:
        """Return positions of a pose, (n,), within the limits.

        They are those to which the search from ``seed`` leads, and otherwise the nearest of those
        found from random starts. The same arguments give the same result.

        Raises Unreachable: with the reason; InvalidArgument: ``target`` is not a pose, or ``seed``
        has a number that is not finite.
        """
        problem, seed = self._problem(target), self._checked_seed(seed)
        self.require_possible(self.forward(seed), problem.target)
        random = np.random.default_rng(0)
        found = problem.solve(np.vstack([seed, self._random(random, RANDOM_STARTS)]), until="first")
        reached = problem.converged(found)
        if reached[0]:
            return self.near(found[0], seed)
        for _ in range(MAX_ROUNDS):
            if reached.any():
                return self._nearest(found[reached], seed)
            found = problem.solve(self._random(random, RANDOM_STARTS), until="any")
            reached = problem.converged(found)
        raise self._obstacle(problem, seed)

    def solutions(self, target: FloatArray, seed: FloatArray) -> FloatArray:
        """Return all positions of a pose that are found, (k, n), nearest first.

        An arm of six joints has up to 16, found from 128 starts; of one with more joints, which
        has infinitely many, some. Turns of joints with a range of more than one are not among
        them: each has the turn that is nearest to ``seed``.

        Raises the errors of ``inverse``.
        """
        problem, seed = self._problem(target), self._checked_seed(seed)
        self.require_possible(self.forward(seed), problem.target)
        starts = self._random(np.random.default_rng(0), MANY_STARTS)
        found = problem.solve(np.vstack([seed, starts]))
        found = found[problem.converged(found)]
        if not len(found):
            return self.inverse(target, seed)[None]
        found = np.array([self.near(solution, seed) for solution in found])
        found = found[
            np.argsort([self.seconds(solution, seed) for solution in found], kind="stable")
        ]
        kept: list[FloatArray] = []
        for solution in found:
            if all(np.abs(solution - other).max() > SAME_RAD for other in kept):
                kept.append(solution)
        return np.array(kept)

    def seconds(self, positions: FloatArray, other: FloatArray) -> float:
        """Return how far apart two positions are: s, at full speed of the slowest joint."""
        return float((np.abs(positions - other) / self.velocity).max())

    def near(self, positions: FloatArray, seed: FloatArray) -> FloatArray:
        """Return the same posture, each joint at the turn nearest to ``seed``."""
        turns = np.where(self._turning, np.round((seed - positions) / TURN), 0.0)
        # As near as the limits allow.
        with np.errstate(invalid="ignore"):
            least = np.ceil((self.lower - OUTSIDE_RAD - positions) / TURN)
            most = np.floor((self.upper + OUTSIDE_RAD - positions) / TURN)
        turns = np.where(self._turning, np.minimum(np.maximum(turns, least), most), 0.0)
        return np.clip(positions + TURN * turns, self.lower, self.upper)

    def singularity(self, positions: FloatArray) -> float:
        """Return the smallest singular value of the Jacobian of the task; 0 is singular.

        Lengths are divided by ``length_m``.
        """
        pose, jacobian = self.chain.forward_and_jacobian(positions)
        scaled = self.weights[:, None] * jacobian * self.joint_lengths
        sizes = np.linalg.svd(self.task.rows(scaled, pose), compute_uv=False)
        return float(sizes[self.rank - 1])

    def require_possible(self, pose: FloatArray, target: FloatArray) -> None:
        """Raise Unreachable for a target that the structure of the arm rules out from ``pose``."""
        if what := self.task.contradiction(pose_differences(pose, target)):
            text = f"the tool would have to move in {what}, which no joint of the arm can"
            if possible := self.task.possible:
                text = f"{text}; the arm moves it in {possible}"
            raise Unreachable(UnreachableCause.ORIENTATION, text)

    def limit_text(self, joint: int, at: float) -> str:
        """Return the reason for a joint, by its index, that would be beyond a limit."""
        name, unit = self.chain.names[joint], self.units[joint]
        limit = self.upper[joint] if at > self.upper[joint] else self.lower[joint]
        return f"{name} would have to be at {at:.4g} {unit}, its limit is {limit:.4g} {unit}"

    @cached_property
    def _turning(self) -> BoolArray:
        """(n,) True for joints that a whole turn brings to the same place."""
        ratios = np.abs(self.chain.ratios)
        slides = self.chain.slides[:, None] & (ratios > 0.0)
        return np.asarray((np.isclose(ratios, np.round(ratios)) & ~slides).all(axis=0))

    def _problem(self, target: FloatArray) -> PoseProblem:
        matrix = checked_pose(target)
        return PoseProblem(self.chain, self.task, matrix, self.lower, self.upper, self.length_m)

    def _checked_seed(self, seed: FloatArray) -> FloatArray:
        positions = np.asarray(seed, np.float64)
        if positions.shape != self.lower.shape or not np.isfinite(positions).all():
            names = ", ".join(self.chain.names)
            raise InvalidArgument(f"seed {seed} must be finite positions of {names}")
        return positions

    def _random(self, random: np.random.Generator, count: int) -> FloatArray:
        lower = np.where(np.isfinite(self.lower), self.lower, -np.pi)
        upper = np.where(np.isfinite(self.upper), self.upper, np.pi)
        return random.uniform(lower, upper, (count, len(lower)))

    def _nearest(self, found: FloatArray, seed: FloatArray) -> FloatArray:
        near = [self.near(solution, seed) for solution in found]
        return min(near, key=lambda solution: self.seconds(solution, seed))

    def _obstacle(self, problem: PoseProblem, seed: FloatArray) -> Unreachable:
        """Return the reason why no start leads to the target."""
        turning = self._turning
        free = replace(
            problem,
            lower=np.where(turning, -np.inf, self.lower),
            upper=np.where(turning, np.inf, self.upper),
        )
        starts = np.vstack([seed, self._random(np.random.default_rng(1), 4 * RANDOM_STARTS)])
        problems, endless = [free], np.full(len(seed), np.inf)
        if problem.slides.any():
            problems.append(replace(free, lower=-endless, upper=endless))
        for beyond in problems:
            found = beyond.solve(starts)
            reached = beyond.converged(found)
            if reached.any():
                return self._beyond_limits(found[reached])
        position = replace(free, task=_position_of(self.task))
        found = position.solve(starts)
        error = np.linalg.norm(position.residual(found)[:, :3], axis=1)
        if error.min() > 1e-5:
            text = f"out of reach: the tool comes within {1e3 * error.min():.1f} mm of it"
            return Unreachable(UnreachableCause.OUT_OF_REACH, text)
        found = free.solve(found, 100)
        residual = free.residual(found)
        near = np.linalg.norm(residual[:, :3], axis=1) / self.length_m
        best = residual[int(np.argmin(near + np.linalg.norm(residual[:, 3:], axis=1)))]
        text = (
            "the position can be reached, but not with this orientation: at best"
            f" {1e3 * np.linalg.norm(best[:3]):.1f} mm and"
            f" {np.degrees(np.linalg.norm(best[3:])):.1f}° are missing"
        )
        return Unreachable(UnreachableCause.ORIENTATION, text)

    def _beyond_limits(self, found: FloatArray) -> Unreachable:
        """Return the reason for a pose that only positions outside of the limits have."""
        middle = np.where(
            np.isfinite(self.lower) & np.isfinite(self.upper), 0.5 * (self.lower + self.upper), 0.0
        )
        turns = np.where(self._turning, np.round((middle - found) / TURN), 0.0)
        found = found + TURN * turns
        excess = np.maximum(np.maximum(self.lower - found, found - self.upper), 0.0)
        excess /= self.joint_lengths
        best = int(np.argmin(excess.max(axis=1)))
        joint = int(np.argmax(excess[best]))
        return Unreachable(UnreachableCause.LIMITS, self.limit_text(joint, found[best, joint]))


def _position_of(task: Task) -> Task:
    """Return the part of a task that is the position."""
    linear = task.chosen[np.abs(task.chosen[:, 3:]).max(axis=1) < 1e-9]
    return replace(task, chosen=linear, about_axis=False)
