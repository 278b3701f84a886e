"""Motion until a contact: torques are compared in the loop, and it ends by the ordinary stop.

The simulation has torques of acceleration and friction; what touches is in tests/plugins/mujoco.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from tests.core.control.harness import FAR, Harness

from robotd.arrays import FloatArray
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.contact import ContactLimits, ContactWatch, WrenchAxis, WrenchLimits
from robotd.device.process_image import ProcessImage, columns
from robotd.device.wrench import WrenchDriver, WrenchSensor
from robotd.errors import InvalidArgument, NotReady
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


STALE_S = 0.1


class Wrist(WrenchDriver):
    """Sensor whose values are those of the test; of the present while it is ``alive``."""

    links: Sequence[str] = ("elbow", "wrist")

    def __init__(self, harness: Harness) -> None:
        self._clock, self._taken_ns = harness.robot.clock, 0
        self.alive = True
        self.wrench: FloatArray = np.array([0.0, 0.0, -6.0, 0.0, 0.0, 0.0])  # its tool's weight

    def read(self, wrenches: FloatArray) -> int:
        if self.alive:
            self._taken_ns = self._clock.now_ns()
        wrenches[0], wrenches[1] = np.nan, self.wrench
        return self._taken_ns

    def sensor(self) -> WrenchSensor:
        return WrenchSensor(self, "wrist", self._clock, STALE_S)


def moved(harness: Harness, limits: WrenchLimits, event: object) -> tuple[Outcome | None, str]:
    """Move, call ``event`` on the way, and return how it has ended: at rest, before the target."""
    with harness.follower.follow(request(harness), contact=limits) as execution:
        harness.run(0.3)
        assert execution.outcome is None
        assert callable(event)
        event()
        harness.end(execution)
    before = harness.image.position.copy()
    harness.run(0.1)
    assert harness.image.position == pytest.approx(before, abs=1e-4)
    assert before[0] < FAR[0] - 0.1
    harness.setpoints.assert_smooth(12.0)
    return execution.outcome, execution.message


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ((0.0, 0.0, 0.0, 11.0), "the force at wrist has changed by 11.00 N, limit 10 N"),
        ((6.0, 8.5, 0.0, 0.0), "the force at wrist has changed by 10.40 N, limit 10 N"),
        ((0.0, 0.0, 0.0, 0.0, -3.0), "the torque at wrist has changed by 3.00 N·m, limit 2 N·m"),
    ],
)
def test_a_wrench_beyond_its_limit_ends_the_motion(
    harness: Harness, change: tuple[float, ...], text: str
) -> None:
    wrist = Wrist(harness)

    def touch() -> None:
        for column, value in zip((0, 1, 4, 2, 5), change, strict=False):
            wrist.wrench[column] += value

    limits = WrenchLimits(wrist.sensor(), 10.0, 2.0)
    outcome, message = moved(harness, limits, touch)
    assert (outcome, message.partition(", at ")[0]) == (Outcome.CONTACT, f"contact: {text}")


SLANTED = np.array([0.0, 0.6, 0.8])


@pytest.mark.parametrize(
    ("sign", "ignored", "change", "text"),
    [
        (0, (99.0, 80.0, -60.0), (0.0, -6.0, -8.0), "the force at wrist along s has changed by 10"),
        (1, (0.0, -60.0, -80.0), (0.0, 6.0, 8.0), "the force at wrist along s has changed by 10"),
        (-1, (0.0, 60.0, 80.0), (0.0, -6.0, -8.0), "the force at wrist along s has changed by 10"),
    ],
)
def test_one_axis_and_sign_of_a_wrench_ends_the_motion(
    harness: Harness, sign: int, ignored: Sequence[float], change: Sequence[float], text: str
) -> None:
    wrist, begin = Wrist(harness), Wrist(harness).wrench[:3].copy()
    seen: list[FloatArray] = []

    def direction(positions: FloatArray) -> FloatArray:
        seen.append(positions)
        return SLANTED

    def touch() -> None:
        wrist.wrench[:3] = begin + ignored
        harness.run(0.1)
        wrist.wrench[:3] = begin + change

    limits = WrenchLimits(wrist.sensor(), 9.5, axis=WrenchAxis("s", direction, sign))
    outcome, message = moved(harness, limits, touch)
    assert outcome is Outcome.CONTACT
    assert message.startswith(f"contact: {text}.00 N, limit 9.5 N")
    assert seen[0][0] < seen[-1][0], "measured positions"


def test_a_torque_about_one_axis_ends_the_motion(harness: Harness) -> None:
    wrist = Wrist(harness)
    axis = WrenchAxis("-z", lambda positions: np.array([0.0, 0.0, 1.0]), -1)

    def touch() -> None:
        wrist.wrench[3:] = 9.0, 9.0, 9.0
        harness.run(0.1)
        wrist.wrench[5] = -3.0

    limits = WrenchLimits(wrist.sensor(), torque_nm=2.0, axis=axis)
    outcome, message = moved(harness, limits, touch)
    assert outcome is Outcome.CONTACT
    assert message.startswith("contact: the torque at wrist along -z has changed by 3.00 N·m")


def test_an_axis_that_is_not_known_ends_the_motion_with_the_reason(harness: Harness) -> None:
    wrist, axis = Wrist(harness), np.array([0.0, 0.0, 1.0])
    limits = WrenchLimits(wrist.sensor(), 10.0, axis=WrenchAxis("z", lambda positions: axis))
    outcome, message = moved(harness, limits, lambda: axis.fill(np.nan))
    assert outcome is Outcome.FAULT
    assert message.startswith("the axis of the force is not known")


def test_a_wrench_that_is_lost_ends_the_motion_with_the_reason(harness: Harness) -> None:
    wrist = Wrist(harness)
    limits = WrenchLimits(wrist.sensor(), 10.0)
    outcome, message = moved(harness, limits, lambda: setattr(wrist, "alive", False))
    assert outcome is Outcome.FAULT
    assert message.startswith(f"the wrench at wrist is {STALE_S + 0.002:.3f} s old, limit 0.1 s")


def test_a_wrench_that_is_not_known_ends_the_motion_with_the_reason(harness: Harness) -> None:
    wrist = Wrist(harness)
    limits = WrenchLimits(wrist.sensor(), torque_nm=2.0)
    outcome, message = moved(harness, limits, lambda: wrist.wrench.__setitem__(0, np.nan))
    assert outcome is Outcome.FAULT
    assert message.startswith("the wrench at wrist is not known, at ")


def test_a_motion_that_may_not_begin_is_rejected(harness: Harness) -> None:
    wrist = Wrist(harness)
    sensor = wrist.sensor()
    with pytest.raises(InvalidArgument, match="force_n is 0, must be above 0"):
        WrenchLimits(sensor, 0.0)
    with pytest.raises(InvalidArgument, match="needs force_n or torque_nm"):
        WrenchLimits(sensor)
    before = WrenchLimits(sensor, 5.0, bias=False)
    reason = "in contact before the motion: the force at wrist is 6.00 N, limit 5 N"
    with (
        pytest.raises(NotReady, match=reason),
        harness.follower.follow(request(harness), contact=before),
    ):
        pass
    wrist.wrench[:] = np.nan
    with (
        pytest.raises(NotReady, match="the wrench at wrist is not known"),
        harness.follower.follow(request(harness), contact=WrenchLimits(sensor, 5.0)),
    ):
        pass
    assert not harness.setpoints.rows
