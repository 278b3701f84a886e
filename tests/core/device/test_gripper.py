"""A gripper on an output bit: moves, travel time, and the sensor that shows a part."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import pytest
from tests.core.control.harness import Harness, arm

from robotd.arrays import FloatArray
from robotd.descriptor import GripperSettings
from robotd.device.gripper import Gripper
from robotd.device.passive_joints import DrivenFingers
from robotd.device.process_image import ProcessImage
from robotd.errors import InvalidArgument, NotReady, Unsupported

GRIPPER = {
    "output_byte": 0,
    "output_bit": 0,
    "joints": ["left", "right"],
    "open_m": 0.0,
    "closed_m": 0.04,
    "travel_time_s": 0.2,
    "part_sensor": {"input_byte": 1, "input_bit": 3},
}


@pytest.fixture
def robot() -> Iterator[Harness]:
    harness = Harness(arm(gripper=GRIPPER)).up()
    yield harness
    harness.robot.shutdown()


def test_it_closes_within_its_travel_time_and_tells_what_it_knows(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    began_s = robot.now_s
    state = gripper.move(0.04, lambda: False)
    assert (state.position_m, state.reached, state.stalled, state.at_rest) == (
        0.04, True, False, True
    )  # fmt: skip
    assert robot.now_s - began_s == pytest.approx(0.25, abs=0.01)
    assert gripper.is_commanded_closed


def test_a_part_stalls_it(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    robot.faults.set_input_bit(1, 3, True)
    state = gripper.move(0.04, lambda: False)
    assert (state.reached, state.stalled, state.at_rest) == (False, True, True)


def test_a_canceled_move_is_not_at_rest(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    begun_s = robot.now_s
    state = gripper.move(0.04, lambda: robot.now_s > begun_s + 0.1)
    assert not state.at_rest
    assert state.position_m == pytest.approx(0.02, abs=2e-3)


def test_a_move_without_the_device_has_no_result(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    begun_s, lose = robot.now_s, iter([robot.faults.drop_communication])

    def lost() -> bool:
        if robot.now_s > begun_s + 0.1:
            next(lose, lambda: None)()
        return False

    with pytest.raises(NotReady, match="engine is not ready"):
        gripper.move(0.0, lost)


@pytest.mark.parametrize("position", [0.1, -0.01, math.nan])
def test_a_position_outside_the_stroke_is_rejected(robot: Harness, position: float) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    with pytest.raises(InvalidArgument, match=r"is outside 0\.0 to 0\.04 m"):
        gripper.checked(position)


def test_the_fingers_travel_whoever_reads_them(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    gripper.move(0.04, lambda: False)
    begun_s = robot.now_s
    state = gripper.move(0.0, lambda: robot.now_s > begun_s + 0.06)
    assert not state.at_rest
    assert state.position_m == pytest.approx(0.028, abs=2e-3)
    assert gripper.position_m == pytest.approx(state.position_m, abs=1e-3)


def test_a_part_stops_the_fingers_where_they_are(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    gripper.command(True)
    robot.run(0.1)
    robot.faults.set_input_bit(1, 3, True)
    robot.run(0.5)
    assert gripper.position_m == pytest.approx(0.02, abs=2e-3)
    assert gripper.move(0.04, lambda: False).position_m == gripper.position_m
    robot.faults.set_input_bit(1, 3, False)
    robot.run(0.5)
    assert gripper.closed == 1.0


def test_the_ends_can_be_set(robot: Harness) -> None:
    gripper = robot.robot.gripper
    assert gripper is not None
    gripper.configure(0.01, 0.03)
    assert gripper.move(0.03, lambda: False).position_m == 0.03
    with pytest.raises(InvalidArgument, match=r"is outside 0\.01 to 0\.03 m"):
        gripper.checked(0.04)


def test_positions_of_fingers_follow_their_multipliers() -> None:
    harness = Harness(arm(gripper={**GRIPPER, "multipliers": [1.0, -2.0]})).up()
    gripper = harness.robot.gripper
    assert gripper is not None
    assert gripper.checked_fingers({"left": 0.02, "right": -0.04}) == pytest.approx(0.02)
    assert gripper.checked_fingers({"right": -0.06}) == pytest.approx(0.03)
    with pytest.raises(InvalidArgument, match=r"by the multipliers 1, -2: they cannot be at left"):
        gripper.checked_fingers({"left": 0.02, "right": 0.02})
    with pytest.raises(InvalidArgument, match="joint thumb is unknown"):
        gripper.checked_fingers({"thumb": 0.0})
    with pytest.raises(InvalidArgument, match="has no position of a finger"):
        gripper.checked_fingers({})
    harness.robot.shutdown()


class MeasuredGripper:
    """A gripper whose fingers move as the test says, in the time of the harness."""

    def __init__(self, harness: Harness) -> None:
        self.fingers = np.zeros(2)
        self.end_m = 0.0
        settings = GripperSettings.model_validate({**GRIPPER, "multipliers": [1.0, -1.0]})
        self.gripper = Gripper(
            harness.robot.io, settings, harness.clock, harness.robot.axes.stop_latch, self._read
        )
        harness.robot.control_loop.every(500, "measured fingers", self._step)

    def _read(self, positions: FloatArray) -> None:
        positions[:] = self.fingers

    def _step(self, image: ProcessImage) -> None:
        step = np.clip(self.end_m - self.fingers[0], -0.0004, 0.0004)
        self.fingers += (step, -step)
        self.gripper.advance(image)


@pytest.fixture
def measured() -> Iterator[MeasuredGripper]:
    harness = Harness(arm())
    gripper = MeasuredGripper(harness)
    harness.up()
    yield gripper
    harness.robot.shutdown()


@pytest.mark.parametrize(
    ("end_m", "reached"),
    [(0.04, True), (0.0275, False), (0.0, False)],
    ids=["end", "part", "stuck"],
)
def test_measured_fingers_are_reported_where_they_come_to_rest(
    measured: MeasuredGripper, end_m: float, reached: bool
) -> None:
    measured.end_m = end_m
    state = measured.gripper.move(0.04, lambda: False)
    assert state.position_m == pytest.approx(end_m, abs=5e-4)
    assert (state.reached, state.stalled, state.at_rest) == (reached, not reached, True)
    assert measured.gripper.finger_positions == pytest.approx([end_m, -end_m], abs=5e-4)
    assert measured.gripper.closed == pytest.approx(end_m / 0.04, abs=0.02)


def test_a_canceled_move_of_measured_fingers_is_not_at_rest(measured: MeasuredGripper) -> None:
    measured.end_m = 0.04
    state = measured.gripper.move(0.04, lambda: measured.fingers[0] > 0.01)
    assert not state.at_rest
    assert 0.01 < state.position_m < 0.02


@pytest.mark.parametrize("error", [None, OSError("no sensor")])
def test_fingers_that_are_not_measured_any_more_are_not_at_rest(
    measured: MeasuredGripper, error: OSError | None
) -> None:
    measured.end_m = 0.04
    read = measured._read

    def fail(positions: FloatArray) -> None:
        read(positions)
        if positions[0] > 0.01:
            positions[:] = np.nan
            if error:
                raise error

    measured.gripper._measured = fail
    state = measured.gripper.move(0.04, lambda: False)
    assert (state.reached, state.stalled, state.at_rest) == (False, False, False)


class DrivenGripper(MeasuredGripper, DrivenFingers):
    """The same, moved by commands, which begin when the test says."""

    names = ("left", "right")
    begins = obeys = True
    stops = 0
    homed_within_s = 0.0

    def __init__(self, harness: Harness) -> None:
        self.commands: list[tuple[Mapping[str, float], float]] = []
        super().__init__(harness)
        self.harness, self.latch = harness, harness.robot.axes.stop_latch
        self.gripper._driver = self

    def read(self, positions: FloatArray) -> None:
        self._read(positions)

    def move(self, positions: Mapping[str, float], force_n: float) -> None:
        self.commands.append((positions, force_n))
        if self.begins:
            self.end_m = positions["left"]

    def stop(self) -> None:
        self.stops += 1
        if self.obeys:
            self.end_m = self.fingers[0]

    def home(self, timeout_s: float) -> None:
        self.end_m, self.homed_within_s = 0.0, timeout_s

    @property
    def at_rest(self) -> bool:
        return self.begins and bool(abs(self.end_m - self.fingers[0]) < 1e-6)


@pytest.fixture
def driven() -> Iterator[DrivenGripper]:
    harness = Harness(arm())
    gripper = DrivenGripper(harness)
    harness.up()
    yield gripper
    harness.robot.shutdown()


def test_driven_fingers_go_to_any_position_with_a_force(driven: DrivenGripper) -> None:
    state = driven.gripper.move(0.015, lambda: False, 20.0)
    assert driven.commands == [({"left": 0.015, "right": -0.015}, 20.0)]
    assert (state.reached, state.stalled) == (True, False)
    assert state.position_m == pytest.approx(0.015, abs=5e-4)


def test_canceling_stops_driven_fingers(driven: DrivenGripper) -> None:
    state = driven.gripper.move(0.04, lambda: driven.fingers[0] > 0.01)
    assert not state.at_rest
    assert driven.end_m == driven.fingers[0] < 0.02


def test_a_stop_of_all_motion_stops_driven_fingers_on_their_way(driven: DrivenGripper) -> None:
    def press_stop() -> bool:
        if driven.fingers[0] > 0.01:
            driven.latch.engage("the operator")
        return False

    with pytest.raises(NotReady, match="the fingers were stopped: the operator"):
        driven.gripper.move(0.04, press_stop)
    driven.harness.run(0.1)
    assert driven.end_m == driven.fingers[0] < 0.02
    assert driven.stops == 1  # at rest they may hold a part, which a stop could release

    for command in (lambda: driven.gripper.command(True), lambda: driven.gripper.drive(0.0, 0.0)):
        with pytest.raises(NotReady, match="motion is stopped: the operator; robotd reset allows"):
            command()
    driven.latch.release(driven.latch.stops)
    driven.harness.run(0.1)
    assert driven.fingers[0] < 0.02  # nothing moves without a new command
    assert driven.gripper.move(0.0, lambda: False).reached


def test_a_stop_of_driven_fingers_is_repeated_until_they_are_at_rest(driven: DrivenGripper) -> None:
    driven.obeys = False
    driven.gripper.drive(0.04, 0.0)
    driven.latch.engage("the operator")
    driven.harness.run(0.05)
    assert driven.stops == 1
    assert driven.fingers[0] < 0.03
    driven.begins = False  # their driver does not know that they are at rest
    driven.harness.run(0.5)
    assert driven.stops >= 2


def test_fingers_that_wait_for_their_stop_are_not_at_rest(driven: DrivenGripper) -> None:
    driven.begins = False
    asked = iter(range(1000))

    def begins_late() -> bool:  # long after fingers that do not begin count as stuck
        if next(asked) == 200:
            driven.begins, driven.end_m = True, 0.04
        return False

    assert driven.gripper.move(0.04, begins_late).reached


@pytest.mark.parametrize("force_n", [-1.0, math.nan, math.inf])
def test_the_force_of_driven_fingers_is_checked(
    driven: DrivenGripper, measured: MeasuredGripper, force_n: float
) -> None:
    with pytest.raises(InvalidArgument, match=r"gripper: force of .* N, must be 0 or more"):
        driven.gripper.checked_force(force_n)
    assert measured.gripper.checked_force(force_n) == 0.0


def test_driven_fingers_are_homed_on_request_and_not_while_motion_is_stopped(
    driven: DrivenGripper,
) -> None:
    driven.gripper.move(0.02, lambda: False)
    assert not driven.homed_within_s
    driven.latch.engage("the operator")
    with pytest.raises(NotReady, match="motion is stopped: the operator"):
        driven.gripper.home()
    assert not driven.homed_within_s
    driven.latch.release(driven.latch.stops)
    driven.gripper.home()
    assert driven.homed_within_s > 10.0


def test_homing_replaces_the_move_before(driven: DrivenGripper) -> None:
    asked = iter(range(1000))

    def homes() -> bool:
        if next(asked) == 10:
            driven.gripper.home()
        return False

    assert not driven.gripper.move(0.04, homes).at_rest


def test_fingers_on_a_valve_are_not_homed(robot: Harness, measured: MeasuredGripper) -> None:
    assert robot.robot.gripper is not None
    for gripper in (robot.robot.gripper, measured.gripper):
        with pytest.raises(Unsupported, match="homing of the gripper: not supported by the sim"):
            gripper.home()


def test_a_driver_without_homing_says_so(driven: DrivenGripper) -> None:
    with pytest.raises(Unsupported, match="homing of the fingers"):
        DrivenFingers.home(driven, 1.0)
