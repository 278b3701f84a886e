"""To which SYNC the values of the image belong."""

from __future__ import annotations

import numpy as np
import pytest
from tests.unit.canopen.network import options, plan

from robotd_canopen.feedback import POSITION, Feedback

ONLINE = np.zeros(2, bool)
CYCLIC = slice(0, 2)  # TPDOs that come with each SYNC; the third comes with each fourth


class Drives:
    """Two drives that answer when they are told to."""

    def __init__(self) -> None:
        self.axes = plan(options()).axes
        self.feedback = Feedback(self.axes, 0.004, 0.1)

    def sync(self) -> None:
        """As the cycle does it."""
        self.feedback.take()
        self.feedback.syncs += 1

    def answer(self, axis: int, count: int = 0, *, which: slice = slice(None)) -> None:
        for pdo in self.axes[axis].tpdos[which]:
            values = [count if entry.base == POSITION else 0 for entry in pdo.entries]
            self.feedback.handler(axis, pdo)(bytearray(pdo.layout.pack(*values)))


@pytest.fixture
def drives() -> Drives:
    """Both have answered the first SYNC, and the second has been sent."""
    drives = Drives()
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
    assert drives.feedback.columns[POSITION][0] == 0
    drives.sync()
    assert drives.feedback.columns[POSITION][0] == 1000


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
