"""Thread of a mobile base."""

from __future__ import annotations

import threading

from tests.fakes import FakeClock

from robotd.control.groups.mobile_base import BaseWorker

TIMEOUT_S = 5.0


def test_it_is_not_settled_from_the_command_to_the_end_of_the_motion() -> None:
    seen: list[tuple[bool, bool]] = []
    ended = threading.Event()

    def see() -> bool:
        seen.append((worker.settled, worker.wait_idle(0.0, FakeClock())))
        return True

    def move() -> None:
        see()
        ended.set()

    worker = BaseWorker(see, move)
    worker.start()
    worker.wake()
    assert ended.wait(TIMEOUT_S)
    worker.close()
    assert seen == [(False, False)] * 2
