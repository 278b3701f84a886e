"""Motion until a contact: torques are compared in the loop, and it ends by the ordinary stop.

The simulation has torques of acceleration and friction; what touches is in tests/plugins/mujoco.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.core.control.harness import FAR, Harness

from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.contact import ContactLimits, ContactWatch
from robotd.device.process_image import ProcessImage, columns
from robotd.errors import NotReady
from robotd.motion import JointLimits, TrajectoryRequest

LIMITS = JointLimits(
    ("a", "b"),
    np.full(2, -3.0),
    np.full(2, 3.0),
    np.full(2, 2.0),
    np.full(2, 8.0),
    units=("rad", "m"),
)


def request(harness: Harness) -> TrajectoryRequest:
    return TrajectoryRequest.from_rows(harness.robot.joint_names, [1.0], [FAR])


def test_a_torque_beyond_its_limit_ends_the_motion_on_the_path(harness: Harness) -> None:
    limits = ContactLimits(np.array([3.0, np.inf, np.inf]))
    with harness.follower.follow(request(harness), contact=limits) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.CONTACT, execution.message
    contact = execution.contact
    assert contact is not None
    assert (contact.joint, abs(contact.change) > 3.0) == ("joint1", True)
    assert execution.message.startswith("contact: the torque of joint1 has changed by ")
    assert "limit 3 N·m, at 0." in execution.message
    ended = harness.image.position
    assert 0.0 <= contact.positions[0] <= ended[0] < FAR[0]
    assert ended == pytest.approx(ended[0] * np.array(FAR), abs=2e-3)
    harness.setpoints.assert_smooth(12.0)


def test_a_joint_without_a_limit_does_not_count(harness: Harness) -> None:
    limits = ContactLimits(np.array([np.inf, 50.0, np.inf]))
    with harness.follower.follow(request(harness), contact=limits) as execution:
        harness.end(execution)
    assert execution.outcome is Outcome.SUCCEEDED
    assert execution.contact is None
    assert "; no contact: the torque" not in execution.message
    assert "; no contact: joint2 has changed by 3." in execution.message


def test_torques_that_are_not_reported_are_refused() -> None:
    wanted = ContactLimits(np.array([1.0, np.inf]))
    wanted.require_torques(LIMITS, np.array([0.0, np.nan]))  # the second does not count
    with pytest.raises(NotReady, match="no torque of a is reported: motion until a contact needs"):
        wanted.require_torques(LIMITS, np.array([np.nan, 0.0]))


def test_one_reading_may_be_noise_and_a_lost_torque_ends_the_motion() -> None:
    image, axes = ProcessImage(2), columns([0, 1])
    watch = ContactWatch(ContactLimits(np.array([2.0, 20.0])), LIMITS)

    def look(*torque: float) -> str:
        image.torque[:] = torque
        image.fresh_ns += 1
        return watch.look(image, axes)

    image.position[:] = 0.5
    assert [look(1.0, 5.0), look(4.0, 5.0), look(1.0, 5.0), look(-0.9, 5.0)] == [""] * 4
    assert watch.most == "a has changed by 3.00 N·m, limit 2 N·m"
    assert not look(1.0, -16.0)
    assert not watch.look(image, axes)  # the same reading again
    assert look(1.0, -16.0) == "contact: the torque of b has changed by -21.00 N, limit 20 N"
    assert watch.contact is not None
    assert watch.contact.positions.tolist() == [0.5, 0.5]
    lost = ContactWatch(ContactLimits(np.array([2.0, np.inf])), LIMITS)
    watch = lost
    assert not look(0.0, 0.0)
    assert not look(np.nan, np.nan)
    assert look(np.nan, np.nan) == "the torque of a is not known"
    assert watch.contact is None
