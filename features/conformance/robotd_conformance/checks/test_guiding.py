"""Hand guiding: a hand moves the axes that were let go, and each is held where it was left."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robotd.api import Capability, FaultInjector, FloatArray, Operation, RobotdError
from robotd_conformance.checks.hand import move_by_hand, require_smooth_begin, small_distances
from robotd_conformance.checks.harness import SETTLED_RAD, Harness

ALARM = 0x2310
STEPS = 10  # of a hand on its way
SIZE_RAD = 0.02

pytestmark = pytest.mark.needs(Capability.HAND_GUIDING)
Ending = Callable[[Harness], None]


@pytest.fixture(autouse=True)
def _robot_can_be_guided(harness: Harness) -> None:
    if not harness.can(Capability.HAND_GUIDING):
        pytest.skip("this robot does not have hand guiding")


def by_stop(harness: Harness) -> None:
    harness.drivers.axes.stop(harness.all)


def by_quick_stop(harness: Harness) -> None:
    harness.drivers.axes.quick_stop(harness.all)


def by_servo(harness: Harness) -> None:
    for axis in harness.all:
        harness.drivers.axes.servo(axis, False, 5.0)


def by_alarm(harness: Harness) -> None:
    for axis in harness.all:
        harness.injector.trip(axis, ALARM)
    harness.until(lambda: bool(harness.image.amp_alarm.all()), "the alarms are shown")


def by_communication(harness: Harness) -> None:
    harness.robot.connection.stop_communication()
    harness.robot.connection.start_communication()
    harness.until(lambda: harness.robot.connection.ready, "the device is ready again")
    image = harness.image
    harness.until(lambda: bool(np.isfinite(image.position).all()), "the positions are known again")


def by_name(function: Ending) -> str:
    return function.__name__


@pytest.mark.clause("AxisDriver.begin_guiding/guides", "AxisDriver.begin_guiding/ends")
@pytest.mark.parametrize("end", [by_stop, by_quick_stop], ids=by_name)
def test_axes_are_held_where_a_hand_has_left_them(
    harness: Harness, injector: FaultInjector, end: Ending
) -> None:
    for turn in (1, -1, 2):  # to both sides, and again
        harness.rest()
        delta = turn * small_distances(harness, SIZE_RAD)
        start = harness.image.position.copy()
        harness.robot.axes.begin_guiding(harness.all)
        require_guided(harness, harness.all)
        lead(harness, injector, delta)
        require_guided(harness, harness.all)
        left = harness.image.position.copy()
        assert left - start == pytest.approx(delta, abs=0.25 * SIZE_RAD)
        with harness.recording() as recording:
            end(harness)
            require_held(harness)
        returned = np.abs(recording.position_command - left).max(0)
        for axis in harness.all:
            assert returned[axis] < 0.5 * abs(delta[axis]), (
                f"axis {axis} was led by {delta[axis]:.2g} rad; its command went back by"
                f" {returned[axis]:.2g} rad when it was held"
            )
        assert harness.image.position == pytest.approx(left, abs=0.25 * SIZE_RAD)
    require_smooth_begin(harness)


@pytest.mark.clause(
    "AxisDriver.begin_guiding/guides", "AxisDriver.begin_guiding/ends", "AxisDriver/others",
    "drivers/rejects",
)  # fmt: skip
def test_one_guided_axis_leaves_the_others_to_their_commands(
    harness: Harness, injector: FaultInjector
) -> None:
    if len(harness.servo_group(0)) > 1:
        pytest.skip("no axis is guided alone")
    for axis in harness.all:
        harness.rest()
        others = [other for other in harness.all if other != axis]
        start = harness.image.position.copy()
        harness.robot.axes.begin_guiding([axis])
        require_guided(harness, [axis])
        assert {int(harness.image.operation[other]) for other in others} <= {Operation.IDLE}
        assert harness.image.servo_on[others].all()
        delta = np.zeros(harness.count)
        delta[axis] = np.sign(harness.travel())[axis] * SIZE_RAD
        lead(harness, injector, delta)
        assert harness.image.position - start == pytest.approx(delta, abs=0.25 * SIZE_RAD)
        with pytest.raises(RobotdError):
            harness.drivers.axes.move(axis, float(start[axis]), harness.profile(axis))
        targets = start.copy()
        targets[others] += 0.1 * harness.travel()[others]
        harness.move(others, targets)
        harness.rest(others)
        assert not harness.off_target(targets, others)
        require_guided(harness, [axis])
        harness.drivers.axes.stop([axis])
        require_held(harness)


@pytest.mark.clause("AxisDriver.begin_guiding/all")
def test_axes_that_are_guided_together_are_not_guided_alone(harness: Harness) -> None:
    if len(harness.servo_group(0)) == 1:
        pytest.skip("each axis is guided alone")
    with pytest.raises(RobotdError):
        harness.drivers.axes.begin_guiding([0], 5.0)
    harness.periods(5)
    guided = np.flatnonzero(harness.image.operation == Operation.GUIDING).tolist()
    assert guided == [], f"axes {guided} are guided, though all were not asked for"
    assert harness.image.servo_on.all()


@pytest.mark.clause("AxisDriver.begin_guiding/all", "AxisDriver.begin_guiding/guides")
def test_no_axis_is_guided_where_one_is_off(harness: Harness) -> None:
    if harness.count < 2 or len(harness.servo_group(harness.count - 1)) > 1:
        pytest.skip("no axis is switched off alone")
    harness.drivers.axes.servo(harness.count - 1, False, 5.0)
    harness.until(lambda: not harness.image.servo_on[-1], "the servo is off")
    with pytest.raises(RobotdError):
        harness.drivers.axes.begin_guiding(harness.all, 5.0)
    harness.periods(5)
    guided = np.flatnonzero(harness.image.operation == Operation.GUIDING).tolist()
    assert guided == [], f"axes {guided} are guided, though axis {harness.count - 1} is off"
    assert harness.image.servo_on[:-1].all()


@pytest.mark.clause("AxisDriver.begin_guiding/ends", "AxisDriver.servo/no-jump")
@pytest.mark.parametrize("end", [by_servo, by_alarm, by_communication], ids=by_name)
def test_guiding_ends_with_the_servo_an_alarm_or_communication(
    harness: Harness, injector: FaultInjector, end: Ending
) -> None:
    delta = small_distances(harness, SIZE_RAD)
    harness.robot.axes.begin_guiding(harness.all)
    lead(harness, injector, delta)
    end(harness)
    harness.periods(5)
    assert {int(operation) for operation in harness.image.operation} == {Operation.IDLE}
    left = harness.image.position.copy()  # an incremental encoder has begun to count anew
    harness.enable()
    harness.periods(5)
    assert {int(operation) for operation in harness.image.operation} == {Operation.IDLE}
    assert harness.image.position == pytest.approx(left, abs=0.25 * SIZE_RAD)


@pytest.mark.clause(
    "AxisDriver.begin_guiding/guides", "AxisDriver.begin_guiding/ends", "AxisDriver/others",
)  # fmt: skip
@pytest.mark.parametrize("end", ["stop", "quick_stop", "servo", "alarm"])
def test_what_ends_the_guiding_of_one_axis_leaves_the_others_guided(
    harness: Harness, injector: FaultInjector, end: str
) -> None:
    """A person may have a hand at each of them, and may have let go of one only."""
    if harness.count < 2 or len(harness.servo_group(0)) > 1:
        pytest.skip("no axis is guided alone")
    if end == "alarm" and harness.can(Capability.CONTROLLER_ALARM):
        pytest.skip("the controller has one alarm for all axes")
    driver, image = harness.drivers.axes, harness.image
    for axis in (0, harness.count - 1):
        harness.robot.axes.begin_guiding(harness.all)
        require_guided(harness, harness.all)
        if end == "servo":
            driver.servo(axis, False, 5.0)
        elif end == "alarm":
            injector.trip(axis, ALARM)
        else:
            getattr(driver, end)([axis])
        harness.until(
            lambda axis=axis: image.operation[axis] == Operation.IDLE,  # type: ignore[misc]
            f"the guiding of axis {axis} ends by {end}",
        )
        harness.periods(5)
        others = [other for other in harness.all if other != axis]
        require_guided(harness, others)
        delta = small_distances(harness, SIZE_RAD)
        delta[axis] = 0.0
        start = image.position.copy()
        lead(harness, injector, delta)
        require_guided(harness, others)
        assert image.position - start == pytest.approx(delta, abs=0.25 * SIZE_RAD)
        driver.stop(harness.all)
        harness.until(
            lambda: bool((image.operation == Operation.IDLE).all()), "no axis is guided any more"
        )
        harness.enable()
        harness.return_to_start()


def lead(harness: Harness, injector: FaultInjector, delta: FloatArray) -> None:
    """Move axes by ``delta`` (n_axes,) in steps, and let go."""
    for _ in range(STEPS):
        move_by_hand(harness, injector, delta / STEPS)
        harness.periods(2)
    harness.periods(5)


def require_guided(harness: Harness, axes: list[int]) -> None:
    """Raise AssertionError where an axis of ``axes`` is not guided, or has another command."""
    image = harness.image.copy()
    for axis in axes:
        operation = Operation(int(image.operation[axis]))
        assert operation is Operation.GUIDING, f"axis {axis} is in {operation.name}, not guided"
    assert image.position_command[axes] == pytest.approx(image.position[axes], abs=SETTLED_RAD)
    assert not image.velocity_command[axes].any()


def require_held(harness: Harness) -> None:
    """Wait until all axes are idle and enabled. Raises AssertionError."""
    image = harness.image

    def held() -> bool:
        return bool((image.operation == Operation.IDLE).all() and image.servo_on.all())

    harness.until(held, "all axes are held, enabled")
    harness.rest()
