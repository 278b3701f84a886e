"""Joint positions along a path of the tool."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotd.api import FloatArray, InvalidArgument
from robotd_tool_space.geometry.kinematics import Kinematics, Unreachable, UnreachableCause
from robotd_tool_space.geometry.rotations import pose_differences
from robotd_tool_space.paths.tool_path import ToolPath

STEP_M, STEP_RAD = 0.002, 0.01  # of the tool between two samples
MIN_SAMPLES, MAX_SAMPLES = 12, 4000  # of each piece
MAX_PATH_SAMPLES = 20_000  # about 20 s of planning, and 40 m
DAMPING = 1e-12  # of squared singular values; lets a step through an exactly singular position end
ACCURACY = 1e-9  # of the positions on the path: rad, and m divided by ``length_m``
MAX_STEP_RAD = 0.3  # of a joint between two samples; a larger one skips something
MAX_BEND_RAD = 0.03  # between two such steps, where samples were not solved one after the other
LOST = 1e-6  # off the path, m and rad
OUTSIDE = 1e-9  # beyond a limit
# Joint speed at full speed of the tool, as a multiple of its limit, that counts as singular: the
# tool would have to slow down to less than a fiftieth.
SINGULAR_RATIO = 50.0
MAX_TRIES = 6
STRIDES = (64, 16)  # samples between two that are solved one after the other


@dataclass(frozen=True, eq=False)
class JointPath:
    """Joint positions at samples of a path, and between them.

    Attributes:
        at_s: (k,) parameter of the path, increasing.
        positions: (k, n), rad or m.
    """

    kinematics: Kinematics
    path: ToolPath
    at_s: FloatArray
    positions: FloatArray

    @cached_property
    def slopes(self) -> FloatArray:
        """(k, n) derivatives by the parameter, from the Jacobian."""
        return slopes(self.kinematics, self.path, self.at_s, self.positions)

    @property
    def rests(self) -> list[int]:
        """Inner samples at which the path stops."""
        ends_s = (self.path.edges_s[piece + 1] for piece in sorted(self.path.stops))
        return [int(np.abs(self.at_s - end_s).argmin()) for end_s in ends_s]

    @property
    def ends_s(self) -> tuple[float, ...]:
        """Parameters at the ends of the curves of the path."""
        return self.path.ends_s

    def poses(self, at_s: FloatArray) -> FloatArray:
        """Return the poses (m, 4, 4) of the path."""
        return self.path.poses(at_s)

    def exact(self, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and derivatives by the parameter, (m, n) each, at (m,) parameters."""
        index = np.clip(np.searchsorted(self.at_s, at_s, "right") - 1, 0, len(self.at_s) - 2)
        width = (self.at_s[index + 1] - self.at_s[index])[:, None]
        part = (at_s[:, None] - self.at_s[index][:, None]) / width
        guess = hermite(
            part,
            self.positions[index],
            self.positions[index + 1],
            width * self.slopes[index],
            width * self.slopes[index + 1],
        )
        positions = correct(self.kinematics, guess, self.path.poses(at_s), iterations=4)
        return positions, slopes(self.kinematics, self.path, at_s, positions)


def hermite(
    part: FloatArray, start: FloatArray, end: FloatArray, leave: FloatArray, arrive: FloatArray
) -> FloatArray:
    """Return the cubic between two values with two derivatives, at ``part`` 0 to 1."""
    rest = 1.0 - part
    return (
        rest * rest * (1.0 + 2.0 * part) * start
        + part * part * (3.0 - 2.0 * part) * end
        + part * rest * (rest * leave - part * arrive)
    )


def solve_path(kinematics: Kinematics, path: ToolPath, start: FloatArray) -> JointPath:
    """Return the joint positions of ``path``, continuously from ``start`` (n,).

    Raises Unreachable: the arm leaves its limits, or is singular; with the place.
    InvalidArgument: the path is too long to be planned at once.
    """
    at_s = _samples(path)
    if len(at_s) > MAX_PATH_SAMPLES:
        raise InvalidArgument(
            f"lines of {len(path.pieces)} pieces need {len(at_s)} steps of {1e3 * STEP_M:g} mm or"
            f" {STEP_RAD:g} rad, at most {MAX_PATH_SAMPLES} are planned: send them in parts"
        )
    poses = path.poses(at_s)
    positions = np.empty((len(at_s), len(start)))
    slope = np.empty_like(positions)
    positions[0] = start
    slope[0] = slopes(kinematics, path, at_s[:1], start[None])[0]
    for index in range(1, len(at_s)):
        step_s = at_s[index] - at_s[index - 1]
        guess = positions[index - 1] + step_s * slope[index - 1]
        here = correct(kinematics, guess[None], poses[index][None], iterations=MAX_TRIES)[0]
        place = float(at_s[index] / at_s[-1])
        positions[index] = here
        slope[index] = slopes(kinematics, path, at_s[index : index + 1], here[None])[0]
        _check(kinematics, positions[index - 1], here, poses[index], place)
    _check_slopes(kinematics, at_s, slope)
    return JointPath(kinematics, path, at_s, positions)


def solve_at_once(kinematics: Kinematics, path: ToolPath, start: FloatArray) -> JointPath:
    """Return what ``solve_path`` does, in a tenth of its time where the arm has one way to follow.

    It is ``solve_path`` that finds the reason where the path cannot be followed.
    """
    at_s = _samples(path)
    found = _follow(kinematics, path, at_s, start)
    if found is None:
        return solve_path(kinematics, path, start)
    return JointPath(kinematics, path, at_s, found)


def _follow(
    kinematics: Kinematics, path: ToolPath, at_s: FloatArray, start: FloatArray
) -> FloatArray | None:
    """Return the positions (k, n) at parameters (k,); None: one after the other may find more.

    Some are solved from the one before, and then all from between two of these.
    """
    if len(at_s) > MAX_PATH_SAMPLES or len(start) != kinematics.rank:
        return None
    poses = path.poses(at_s)
    for stride in STRIDES:
        with np.errstate(all="ignore"):  # what diverges is judged after it
            found = _solve_between(kinematics, poses, start, stride)
            if _is_followed(kinematics, at_s, poses, found):
                return found
    return None


def _solve_between(
    kinematics: Kinematics, poses: FloatArray, start: FloatArray, stride: int
) -> FloatArray:
    guess = np.tile(start, (len(poses), 1))
    for first in range(0, len(poses) - 1 - stride, stride):
        last, before = first + stride, guess[first]
        end = correct(kinematics, before[None], poses[last][None], iterations=2 * MAX_TRIES)[0]
        parts = np.arange(1, stride + 1)[:, None] / stride
        guess[first + 1 : last + 1] = before + parts * (end - before)
        guess[last + 1 :] = end  # near enough for what is left after the last of them
    positions = correct(kinematics, guess, poses, iterations=MAX_TRIES)
    positions[0] = start
    return positions


def _is_followed(
    kinematics: Kinematics, at_s: FloatArray, poses: FloatArray, positions: FloatArray
) -> bool:
    """Return whether positions are on the path, within the limits, and on one way along it."""
    error = pose_differences(kinematics.forward(positions), poses) @ kinematics.task.chosen.T
    excess = np.maximum(kinematics.lower - positions, positions - kinematics.upper)
    steps = np.diff(positions, axis=0)
    ratios = np.abs(steps) / np.diff(at_s)[:, None] / kinematics.velocity
    # Two steps that differ much: the arm may have gone over to another way to reach the poses.
    bends = np.abs(np.diff(np.abs(steps), axis=0)).max(initial=0.0)
    return bool(
        np.abs(error).max() <= LOST
        and excess.max() <= OUTSIDE
        and np.abs(steps).max() <= MAX_STEP_RAD
        and bends <= MAX_BEND_RAD
        and ratios.max() <= SINGULAR_RATIO
    )


def correct(
    kinematics: Kinematics, positions: FloatArray, poses: FloatArray, iterations: int
) -> FloatArray:
    """Return positions (k, n) brought to the poses (k, 4, 4) by Newton's iteration."""
    weights = kinematics.weights
    task, chain = kinematics.task, kinematics.chain
    for _ in range(iterations):
        pose, jacobian = chain.forward_and_jacobian(positions)
        error = task.errors(pose_differences(pose, poses) * weights, pose, poses)
        if np.abs(error).max() < ACCURACY:
            break
        rows = task.rows(jacobian * weights[:, None], pose)
        positions = positions + _least_squares(rows, error)
    return positions


def slopes(
    kinematics: Kinematics, path: ToolPath, at_s: FloatArray, positions: FloatArray
) -> FloatArray:
    """Return the joint velocities (k, n) at unit speed of the parameter."""
    weights, edges, half_s = kinematics.weights, path.edges_s, 1e-5 * path.edges_s[-1]
    # One-sided at both ends and never across a corner that is a stop: the piece decides.
    piece = np.clip(np.searchsorted(edges, at_s, "right") - 1, 0, len(path.pieces) - 1)
    before = np.maximum(at_s - half_s, edges[piece])
    after = np.minimum(at_s + half_s, edges[piece + 1])
    poses = path.poses(np.concatenate([before, after]))
    difference = pose_differences(poses[: len(at_s)], poses[len(at_s) :])
    twist = difference / np.maximum(after - before, 1e-12)[:, None] * weights
    pose, jacobian = kinematics.chain.forward_and_jacobian(positions)
    rows = kinematics.task.rows(jacobian * weights[:, None], pose)
    wanted = twist @ kinematics.task.chosen.T
    if kinematics.task.about_axis:
        z = pose[..., :3, 2]
        across = twist[:, 3:] - z * (z * twist[:, 3:]).sum(axis=-1, keepdims=True)
        wanted = np.concatenate([wanted, across], axis=-1)
    return _least_squares(rows, wanted)


def _least_squares(rows: FloatArray, values: FloatArray) -> FloatArray:
    """Return the smallest (k, n) whose product with the rows is the values."""
    transposed = np.swapaxes(rows, -1, -2)
    count, joints = rows.shape[-2:]
    if count > joints:  # more components than joints
        normal = transposed @ rows + DAMPING * np.eye(joints)
        found = np.linalg.solve(normal, transposed @ values[..., None])
    else:
        found = transposed @ np.linalg.solve(
            rows @ transposed + DAMPING * np.eye(count), values[..., None]
        )
    return np.asarray(found[..., 0], np.float64)


def _samples(path: ToolPath) -> FloatArray:
    """Return the parameters to compute joints at; each end of a piece is one."""
    at_s = [np.zeros(1)]
    for first, piece in zip(path.edges_s, path.pieces, strict=False):
        steps = float((piece.curve.rates * piece.length_s / (STEP_M, STEP_RAD)).max())
        count = int(min(max(np.ceil(steps), MIN_SAMPLES), MAX_SAMPLES))
        at_s.append(first + piece.length_s * np.arange(1, count + 1) / count)
    return np.concatenate(at_s)


def _check(
    kinematics: Kinematics, before: FloatArray, here: FloatArray, pose: FloatArray, place: float
) -> None:
    """Raise Unreachable for positions outside of the limits, off the path, or too far."""
    names = kinematics.chain.names
    step = np.abs(here - before)
    error = pose_differences(kinematics.forward(here), pose) @ kinematics.task.chosen.T
    lost = not np.isfinite(here).all() or np.abs(error).max() > LOST
    joint = int(np.argmax(np.nan_to_num(step, nan=np.inf)))
    if lost or step[joint] > MAX_STEP_RAD:
        if kinematics.singularity(before) < 0.05:
            text = f"{names[joint]} cannot follow the line: the arm is singular"
            raise Unreachable(UnreachableCause.SINGULAR, text, place)
        text = "the line leaves the reach of the arm"
        raise Unreachable(UnreachableCause.OUT_OF_REACH, text, place)
    excess = np.maximum(kinematics.lower - here, here - kinematics.upper)
    joint = int(np.argmax(excess))
    if excess[joint] > OUTSIDE:
        raise Unreachable(UnreachableCause.LIMITS, kinematics.limit_text(joint, here[joint]), place)


def _check_slopes(kinematics: Kinematics, at_s: FloatArray, slope: FloatArray) -> None:
    """Raise Unreachable where a joint would have to be far too fast."""
    ratio = np.abs(slope) / kinematics.velocity
    index, joint = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    if ratio[index, joint] > SINGULAR_RATIO:
        text = (
            f"{kinematics.chain.names[joint]} would have to be {ratio[index, joint]:.0f} times as"
            " fast as its limit: the arm is nearly singular"
        )
        raise Unreachable(UnreachableCause.SINGULAR, text, float(at_s[index] / at_s[-1]))
