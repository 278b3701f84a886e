"""External wrench at the end of the arm, as its control unit estimates it from joint torques.

FCI reports it at its stiffness frame, as the wrench of the arm on its environment, and all zeros
near a singular position of the arm. robotd has the wrench on the arm, at the link of joint 7.
"""

from __future__ import annotations

from collections.abc import Sequence

import franky
import numpy as np

from robotd.api import FloatArray, RobotDescriptor, WrenchDriver, read_urdf
from robotd_franka.device import FrankaDevice

FLANGE_M = 0.107  # along z from the frame of joint 7, without rotation: FR3 and Panda


class FrankaWrenches(WrenchDriver):
    """Wrench that acts on the link of the last joint; load and end effector are compensated."""

    def __init__(self, device: FrankaDevice, link: str) -> None:
        self._device, self._link = device, link

    @property
    def links(self) -> Sequence[str]:
        return (self._link,)

    def read(self, wrenches: FloatArray) -> int:
        link = self._device.live
        state = link.state if link is not None else None
        if state is None:
            wrenches[:] = np.nan
            return 0
        wrenches[0] = wrench_on_link(state.reported)
        return state.time_ns


def last_link(robot: RobotDescriptor) -> str | None:
    """Return the link that the last joint moves; None without a URDF."""
    if robot.urdf is None:
        return None
    joint = max(robot.joints, key=lambda joint: joint.axis)
    return read_urdf(robot.urdf).joint[joint.name].child


def wrench_on_link(state: franky.RobotState) -> FloatArray:
    """Return force and torque (6,) on the link of joint 7, in its frame; NaN: not known."""
    estimate = state.K_F_ext_hat_K
    if not estimate.any():  # the arm is near a singular position
        return np.full(6, np.nan)
    frame = (state.F_T_EE * state.EE_T_K).matrix  # of K at the flange
    rotation, origin = frame[:3, :3], frame[:3, 3] + (0.0, 0.0, FLANGE_M)
    force = -rotation @ estimate[:3]
    torque = -rotation @ estimate[3:] + np.cross(origin, force)
    return np.concatenate([force, torque])
