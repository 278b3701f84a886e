"""To which SYNC the values of the image belong, and which of them are believed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.fakes import FakeClock
from tests.plugins.canopen.network import drive, options, plan

from robotd.descriptor import RobotDescriptor
from robotd_canopen.feedback import Feedback
from robotd_canopen.master import Master
from robotd_cia402.object_numbers import DEMAND, INPUTS, MODE_DISPLAY, POSITION
from robotd_cia402.scaling import Scaling

ONLINE = np.zeros(2, bool)
WINDOW_SYNCS = 10
FOUND_SYNCS = 60  # another drive with the id is found: 0.24 s at 4 ms
REACH = 16_000  # counts: 100 rad/s for twice 20 SYNCs
CYCLIC = slice(0, 2)  # TPDOs that come with each SYNC; the third comes with each fourth


class Drives:
    """Two drives that answer on request."""

    def __init__(self, **keys: Any) -> None:
        self.axes = plan(options(**keys)).axes
        self.feedback = Feedback(self.axes, 0.004, 0.1)
        for number in range(len(self.axes)):
            self.feedback.accept(number)
        self.handlers = {
            (number, pdo.cob_id): self.feedback.handler(number, pdo, Scaling(axis.options, None))
            for number, axis in enumerate(self.axes)
            for pdo in axis.tpdos
        }

    def sync(self) -> None:
        """As the cycle does it."""
        self.feedback.take()
        self.feedback.syncs += 1

    def position(self, axis: int) -> int:
        """Return the position of ``axis`` as taken last."""
        return self.feedback.values[axis][INPUTS.index(POSITION)]

    def answer(
        self,
        axis: int,
        count: int = 0,
        *,
        which: slice = slice(None),
        mode: int = 0,
        demand: int = 0,
    ) -> None:
        known = {POSITION: count, MODE_DISPLAY: mode, DEMAND: demand}
        for pdo in self.axes[axis].tpdos[which]:
            values = [known.get(entry.base, 0) for entry in pdo.entries]
            self.handlers[axis, pdo.cob_id](bytearray(pdo.layout.pack(*values)))


@pytest.fixture
def drives() -> Drives:
    """Both have answered the first SYNC, and the second has been sent."""
    drives = Drives()
    for axis in (0, 1):
        drives.answer(axis)  # the position is confirmed by the next one
    drives.sync()
    drives.answer(0)
    drives.answer(1)
    drives.sync()
    return drives


def test_the_image_is_of_the_sync_before(drives: Drives) -> None:
    assert drives.feedback.behind(ONLINE) == 1
    drives.feedback.take()
    assert drives.feedback.behind(ONLINE) == 1


def test_a_quick_answer_belongs_to_the_next_image(drives: Drives) -> None:
    drives.answer(0, 1000)
    assert drives.position(0) == 0
    drives.sync()
    assert drives.position(0) == 1000


def test_the_most_silent_drive_counts_unless_it_is_offline(drives: Drives) -> None:
    for _ in range(3):
        drives.answer(0, which=CYCLIC)
        drives.sync()
    assert drives.feedback.behind(ONLINE) == 4
    assert drives.feedback.behind(np.array([False, True])) == 1
    assert drives.feedback.behind(~ONLINE) == drives.feedback.syncs


def test_answers_between_two_syncs_are_of_the_last_one(drives: Drives) -> None:
    drives.answer(0)
    drives.answer(1)
    drives.feedback.take()
    assert drives.feedback.behind(ONLINE) == 0


def test_a_position_that_cannot_be_is_not_believed(drives: Drives) -> None:
    with pytest.raises(ValueError, match="the position jumps by -20 rad"):
        drives.answer(0, -20_000, which=CYCLIC)
    drives.answer(0, 100)
    drives.sync()
    assert drives.position(0) == 100


def test_a_leap_is_believed_when_the_next_position_is_near_it(drives: Drives) -> None:
    with pytest.raises(ValueError, match="jumps by 20 rad"):
        drives.answer(0, 20_000, which=CYCLIC)
    drives.answer(0, 20_010)
    drives.sync()
    assert drives.position(0) == 20_010


def test_the_first_position_after_the_start_is_believed_when_it_is_confirmed(
    drives: Drives,
) -> None:
    drives.feedback.forget(0)
    drives.feedback.accept(0)
    drives.answer(0, 2_000_000)
    drives.sync()
    assert not drives.feedback.complete(0)
    drives.answer(0, 2_000_001)
    drives.sync()
    assert drives.position(0) == 2_000_001


@pytest.mark.parametrize("mode", [8, 6])  # 6: homing
def test_garbage_is_not_believed_as_the_first_position_nor_while_homing(
    drives: Drives, mode: int
) -> None:
    drives.feedback.forget(0)
    drives.feedback.accept(0)
    if mode == 6:
        drives.answer(0, 500, mode=mode)
        drives.answer(0, 500, mode=mode)
    drives.answer(0, -2_000_000, mode=mode)
    drives.answer(0, 500, mode=mode)
    drives.answer(0, 501, mode=mode)
    drives.sync()
    assert drives.position(0) == 501


def test_a_demand_that_cannot_be_is_not_believed_before_it_is_confirmed(drives: Drives) -> None:
    taken = INPUTS.index(DEMAND)
    drives.answer(0, demand=2_000_000)
    drives.sync()
    assert drives.feedback.values[0][taken] == 0
    drives.answer(0, demand=2_000_001)
    drives.sync()
    assert drives.feedback.values[0][taken] == 2_000_001


def test_an_endless_axis_runs_over_without_a_leap(drives: Drives) -> None:
    drives.feedback.forget(0)
    drives.feedback.accept(0)
    drives.answer(0, 2**31 - 5)
    drives.answer(0, -(2**31) + 5)


def test_frames_before_the_start_of_a_drive_do_not_count(drives: Drives) -> None:
    drives.feedback.forget(0)
    pdo = drives.axes[0].tpdos[0]
    drives.handlers[0, pdo.cob_id](bytearray(2))  # of a drive that starts by itself
    drives.answer(0, 500)
    drives.sync()
    assert not drives.feedback.complete(0)
    assert drives.position(0) == 0


EVENT_DRIVEN = [
    {"number": 1, "transmission": 1, "objects": ["0x6041", "0x6061"]},
    {"number": 2, "transmission": 255, "objects": ["0x6064", "0x60F4"]},
    {"number": 3, "transmission": 254, "objects": ["0x60F4"]},  # nothing that an axis takes
]


@pytest.fixture
def event_driven() -> Drives:
    """Axis 0 sends its position on an event, and has answered the first SYNC."""
    drives = Drives(axes=[drive(0, tpdos=EVENT_DRIVEN), drive(1)])
    drives.answer(1)
    drives.sync()
    drives.answer(0, which=slice(0, 1))
    drives.answer(1)
    drives.sync()
    return drives


def test_an_axis_is_known_when_its_event_driven_position_has_come(event_driven: Drives) -> None:
    feedback = event_driven.feedback
    assert feedback.complete(1)
    assert not feedback.complete(0)
    assert [pdo.name for pdo in feedback.missing(0)] == ["TPDO 2"]
    event_driven.answer(0, 700, which=slice(1, 2))
    event_driven.sync()
    assert feedback.complete(0)
    assert event_driven.position(0) == 700


def test_an_event_driven_position_is_never_late(event_driven: Drives) -> None:
    feedback = event_driven.feedback
    event_driven.answer(0, 700, which=slice(1, 2))
    for _ in range(100):
        event_driven.answer(0, which=slice(0, 1))
        event_driven.answer(1)
        event_driven.sync()
    assert not feedback.stale()
    assert feedback.behind(ONLINE) == 1


@pytest.mark.parametrize(("comes", "expected"), [(False, 600), (True, 700)])
def test_values_read_by_sdo_are_older_than_a_tpdo(
    event_driven: Drives, comes: bool, expected: int
) -> None:
    feedback, pdo = event_driven.feedback, event_driven.axes[0].tpdos[1]
    if comes:
        event_driven.answer(0, 700, which=slice(1, 2))
    feedback.seed(0, pdo, {POSITION: 600})
    event_driven.sync()
    assert feedback.complete(0)
    assert event_driven.position(0) == expected


def test_a_first_position_is_not_known_before_it_is_taken() -> None:
    """The frame comes while the control loop takes the values."""
    drives = Drives()
    feedback = drives.feedback
    drives.answer(0, 5000)  # the next one confirms it

    class Arrived(np.ndarray):
        def tolist(self) -> Any:
            before = super().tolist()
            drives.answer(0, 5000)
            return before

    feedback._arrived = feedback._arrived.view(Arrived)
    drives.sync()
    assert not feedback.complete(0)
    drives.sync()
    assert feedback.complete(0)
    assert drives.position(0) == 5000


@given(st.lists(st.integers(-(2**31), 2**31 - 1).filter(lambda count: abs(count) > REACH)))
def test_garbage_between_two_positions_changes_nothing(garbage: list[int]) -> None:
    drives = Drives()
    drives.answer(0)
    drives.answer(0)
    for count in garbage:
        with pytest.raises(ValueError, match="jumps"):
            drives.answer(0, count, which=CYCLIC)
        drives.answer(0, 5)
        drives.sync()
        assert drives.position(0) == 5


def answer_cyclic(drives: Drives, counts: list[int]) -> None:
    """Let drive 0 send its cyclic TPDOs so many times after each of the next SYNCs."""
    for count in counts:
        for _ in range(count):
            drives.answer(0, which=CYCLIC)
        drives.sync()


def test_a_tpdo_that_comes_more_often_than_sync_is_of_two_drives(drives: Drives) -> None:
    answer_cyclic(drives, [2] * FOUND_SYNCS)
    assert drives.feedback.is_counted(0)
    assert drives.feedback.doubled(0) is drives.axes[0].tpdos[0]
    assert drives.feedback.doubled(1) is None


@pytest.mark.parametrize("missing", [0, 100, 10_000])
def test_another_drive_that_comes_in_operation_is_found(drives: Drives, missing: int) -> None:
    """Where answers are missing it takes as many SYNCs longer, and at most 500."""
    answer_cyclic(drives, [1] * 500 + [0] * missing)
    since = drives.feedback.windows
    answer_cyclic(drives, [2] * (FOUND_SYNCS + min(missing, 500)))
    assert drives.feedback.is_counted(0, since)
    assert drives.feedback.doubled(0) is not None


@pytest.mark.parametrize(
    ("stalled", "at_once"), [(3, 500), (15, 500), (125, 500), (500, 500), (125, 5), (500, 20)]
)
def test_answers_that_have_waited_are_not_of_another_drive(
    drives: Drives, stalled: int, at_once: int
) -> None:
    """Those of a drive, or of a receive thread, that stood still, also from before ``accept``."""
    waiting = stalled
    answer_cyclic(drives, [0] * stalled)
    drives.feedback.accept(0)
    while waiting:
        waiting += 1
        came = min(waiting, at_once)
        waiting -= came
        answer_cyclic(drives, [came])
        assert drives.feedback.doubled(0) is None
    since = drives.feedback.windows
    answer_cyclic(drives, [1] * 2 * WINDOW_SYNCS)
    assert drives.feedback.is_counted(0, since)
    assert drives.feedback.doubled(0) is None


@pytest.mark.parametrize("stalled", [15, 40, 125, 480])
@pytest.mark.parametrize("at_once", [2, 3, 5, 500])
def test_answers_that_come_late_are_not_of_another_drive(
    drives: Drives, stalled: int, at_once: int
) -> None:
    """Of a drive that starts on a busy computer: its answers come slowly, and none is lost."""
    waiting = 0
    for period in range(stalled + 2000):
        waiting += 1
        came = 0 if period < stalled else min(waiting, at_once)
        waiting -= came
        answer_cyclic(drives, [came])
        assert drives.feedback.doubled(0) is None


def test_an_event_driven_tpdo_may_come_at_any_rate(event_driven: Drives) -> None:
    for _ in range(60):
        event_driven.answer(0)
    assert event_driven.feedback.doubled(0) not in [
        pdo for pdo in event_driven.axes[0].tpdos if pdo.is_event_driven
    ]


@pytest.mark.parametrize(("objects", "turn"), [(["0x606C"], 20), (["0x6077"], 10)])
def test_the_turn_of_the_velocity_is_that_of_its_source(objects: list[str], turn: int) -> None:
    """Without object 0x606C it is computed from positions."""
    tpdos = [
        {"number": 1, "transmission": 10, "objects": ["0x6041", "0x6061", "0x6064"]},
        {"number": 2, "transmission": 20, "objects": objects},
    ]
    layout = plan(options(axes=[drive(0, tpdos=tpdos), drive(1)]))
    robot = RobotDescriptor.model_validate({"schema": 1, "name": "test", "axes": 2})
    slow, usual = (axis.drive for axis in Master(robot, layout, FakeClock()).axes)
    assert (slow.turn, slow.velocity_turn) == (20, turn)
    assert (usual.turn, usual.velocity_turn) == (4, 1)


def test_a_tpdo_that_is_shorter_than_mapped_has_that_name(drives: Drives) -> None:
    pdo = drives.axes[0].tpdos[0]
    handler, feedback = drives.handlers[0, pdo.cob_id], drives.feedback
    with pytest.raises(ValueError, match="TPDO 1 has 4 bytes, 7 are mapped"):
        handler(bytearray(4))
    assert feedback.name(0, pdo) == "TPDO 1 (shorter than mapped: 4 of 7 bytes)"
    assert feedback.name(1, drives.axes[1].tpdos[0]) == "TPDO 1"
    drives.answer(0)
    assert feedback.name(0, pdo) == "TPDO 1"


@pytest.mark.parametrize("echoes", [False, True])
def test_a_second_sync_producer_is_found_within_two_windows_and_forgotten_when_it_ends(
    drives: Drives, *, echoes: bool
) -> None:
    feedback, found = drives.feedback, []
    feedback.echoes = echoes
    for comes in (False, True, False):
        for _ in range(2 * WINDOW_SYNCS):
            for _ in range(comes + echoes):
                feedback.note_sync(bytearray())
            drives.sync()
        feedback.take()
        found.append(feedback.second_sync)
    assert found == [False, True, False]


def test_echoes_that_come_late_are_no_second_producer(drives: Drives) -> None:
    drives.feedback.echoes = True
    for number in range(8 * WINDOW_SYNCS):
        for _ in range(0 if number % 40 < 30 else 4):
            drives.feedback.note_sync(bytearray())
        drives.sync()
        assert not drives.feedback.second_sync
