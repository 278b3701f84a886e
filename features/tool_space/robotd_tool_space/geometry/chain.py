"""Serial chain of a URDF: forward kinematics and Jacobian, of many positions at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotd.api import BoolArray, DescriptorError, FloatArray, UrdfJoint, UrdfRobot
from robotd_tool_space.geometry.rotations import skew

SPEED_STEP_S = 1e-3  # off by 1 µm/s at 3 rad/s


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints between a base and a tool. Immutable; any thread.

    The frame of link k in that of link k - 1 is ``constant + f·first + g·second`` with f, g = sin
    and 1 - cos of the position of a turning joint, f = the position of a sliding one: Rodrigues'
    formula, multiplied out with the origin.

    Attributes:
        names: the n joints that are commanded, in the order of positions.
        base, link: names of the links at both ends.
        slides: (m,) True for each moving joint of the chain that is prismatic.
        ratios, offsets: (m, n), (m,): positions of the m moving joints of the chain are
            ratios · positions + offsets. Joints with <mimic> make them more than the commanded.
        constant, first, second: (m, 4, 4), see above.
        axes: (m, 3) axis of each moving joint in its own frame.
        end: (4, 4) of the tool in the frame of the last moving joint.
        moving: names of the m moving joints.
    """

    names: tuple[str, ...]
    base: str
    link: str
    slides: BoolArray
    ratios: FloatArray
    offsets: FloatArray
    constant: FloatArray
    first: FloatArray
    second: FloatArray
    axes: FloatArray
    end: FloatArray
    moving: tuple[str, ...]

    @classmethod
    def of_urdf(
        cls, urdf: UrdfRobot, names: Sequence[str], link: str, others: Sequence[str] = ()
    ) -> Chain:
        """Return the chain that carries ``link``.

        Its base is the root of the URDF, or the last link that a joint of ``others`` moves.

        Args:
            names: joints that are commanded.
            others: joints that something else commands.

        Raises DescriptorError: one of ``others`` is between joints of ``names``, or none of these
        moves the link.
        """
        known = {*names, *others}
        path: list[UrdfJoint] = []
        base = link
        while base != urdf.root:
            joint = urdf.parent_joint[base]
            if joint.moves and urdf.leader(joint, known)[0].name in others:
                break
            path.insert(0, joint)
            base = joint.parent
        at = base
        while at != urdf.root:
            joint = urdf.parent_joint[at]
            if joint.moves and urdf.leader(joint, known)[0].name in names:
                break_joint = urdf.parent_joint[base].name
                text = f"joint {break_joint!r} of another group is between {joint.name!r} and"
                raise DescriptorError(f"{text} the tool {link!r}")
            at = joint.parent
        return cls._of_joints(urdf, tuple(names), base, link, path)

    @classmethod
    def _of_joints(
        cls,
        urdf: UrdfRobot,
        names: tuple[str, ...],
        base: str,
        link: str,
        path: Sequence[UrdfJoint],
    ) -> Chain:
        column = {name: index for index, name in enumerate(names)}
        before = np.eye(4)  # what is fixed since the last moving joint
        frames: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        ratios, offsets, axes, slides, moving = [], [], [], [], []
        for joint in path:
            leader, ratio, offset = urdf.leader(joint, column)
            if not joint.moves or leader.name not in column:
                before = before @ joint.transform(urdf.position(joint, {}))
                continue
            row = np.zeros(len(names))
            row[column[leader.name]] = ratio
            ratios.append(row)
            offsets.append(offset)
            axes.append(joint.axis)
            slides.append(joint.type == "prismatic")
            moving.append(joint.name)
            frames.append(_frames(before @ joint.origin, joint))
            before = np.eye(4)
        if not frames:
            raise DescriptorError(f"no joint of {', '.join(names)} moves the tool {link!r}")
        constant, first, second = (np.array(matrix) for matrix in zip(*frames, strict=True))
        return cls(
            names,
            base,
            link,
            np.array(slides),
            np.array(ratios),
            np.array(offsets),
            constant,
            first,
            second,
            np.array(axes),
            before,
            tuple(moving),
        )

    def with_tool(self, offset: FloatArray) -> Chain:
        """Return the chain of a tool at ``offset`` (4, 4) from the link."""
        return replace(self, end=self.end @ offset)

    def forward(self, positions: FloatArray) -> FloatArray:
        """Return the poses (..., 4, 4) of the tool at positions (..., n)."""
        return self.frames(positions)[..., -1, :, :] @ self.end

    def forward_and_jacobian(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return poses (..., 4, 4) and Jacobians (..., 6, n) of positions (..., n).

        The Jacobian takes joint velocities to the velocity of the tool's origin, m/s, and its
        angular velocity, rad/s, both in the axes of the base (the geometric Jacobian).
        """
        frames = self.frames(positions)
        pose = frames[..., -1, :, :] @ self.end
        axes = (frames[..., :3, :3] @ self.axes[..., None])[..., 0]
        arms = pose[..., None, :3, 3] - frames[..., :3, 3]
        columns = np.empty((*axes.shape[:-1], 6))
        columns[..., :3] = np.where(self.slides[:, None], axes, _cross(axes, arms))
        columns[..., 3:] = np.where(self.slides[:, None], 0.0, axes)
        return pose, np.swapaxes(columns, -1, -2) @ self.ratios

    def speeds(
        self, positions: FloatArray, velocities: FloatArray, points: FloatArray
    ) -> FloatArray:
        """Return speeds (..., m + p), m/s, of the links' origins and of ``points``, in the base.

        From the displacement between positions ``SPEED_STEP_S`` apart: that is as fast as the
        Jacobian of a single point.

        Args:
            positions, velocities: (..., n).
            points: (p, 3) in the frame of the last moving link.
        """
        half = 0.5 * SPEED_STEP_S * velocities
        frames = self.frames(np.stack([positions - half, positions + half]))
        last = frames[..., -1, :, :]
        fixed = points @ np.swapaxes(last[..., :3, :3], -1, -2) + last[..., None, :3, 3]
        places = np.concatenate([frames[..., :3, 3], fixed], axis=-2)
        path = places[1] - places[0]
        speeds: FloatArray = np.sqrt((path * path).sum(axis=-1)) / SPEED_STEP_S
        return speeds

    def frames(self, positions: FloatArray) -> FloatArray:
        """Return the frames (..., m, 4, 4) of all links that move, in the base."""
        at = positions @ self.ratios.T + self.offsets
        first = np.where(self.slides, at, np.sin(at))[..., None, None]
        second = np.where(self.slides, 0.0, 1.0 - np.cos(at))[..., None, None]
        frames: FloatArray = self.constant + first * self.first + second * self.second
        for index in range(1, frames.shape[-3]):
            frames[..., index, :, :] = frames[..., index - 1, :, :] @ frames[..., index, :, :]
        return frames


def _frames(origin: FloatArray, joint: UrdfJoint) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the constant part and the factors of f and g, each (4, 4)."""
    first, second = np.zeros((2, 4, 4))
    if joint.type == "prismatic":
        first[:3, 3] = joint.axis
    else:
        cross = skew(joint.axis)
        first[:3, :3], second[:3, :3] = cross, cross @ cross
    return origin, origin @ first, origin @ second


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return cross products over the last dimension; NumPy's own takes five times as long."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    result[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    result[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    result[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result
