"""Claims of axes, and axes that are kept at rest."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import pytest
from tests.core.device.harness import ALL, ONE_AXIS, PROFILE, Harness, rejected

from robotd.device.axes import Move
from robotd.device.capabilities import Capability
from robotd.device.state import CommandMode, Operation
from robotd.errors import (
    NotReady,
)


def test_claimed_axes_refuse_everybody_but_a_stop(harness: Harness) -> None:
    with harness.axes.claimed("the test", [0, 1]):
        harness.refresh()
        text = "^joint1: in use by the test$"
        for name in ("clear_alarm", "set_command_mode", "home", "move"):
            rejected(harness, NotReady, text, lambda name=name: ONE_AXIS[name](harness.axes, 0))
        harness.axes.move([Move(2, 0.5, PROFILE)])
        harness.axes.servo(1, False)
        harness.axes.stop([0])
        harness.axes.quick_stop([0])
        assert harness.axes.rejection(0, CommandMode.POSITION, by="the test") is None
    harness.refresh()
    harness.axes.move([Move(0, 0.5, PROFILE)])
    names = [call[0] for call in harness.driver.calls]
    assert names == [
        "begin_stream", "move", "servo", "stop", "quick_stop", "end_stream", "move",
    ]  # fmt: skip


def test_a_claim_ends_with_its_block_whatever_happens_in_it(harness: Harness) -> None:
    with pytest.raises(ZeroDivisionError), harness.axes.claimed("the test", [0]):
        raise ZeroDivisionError
    harness.refresh()
    assert harness.axes.rejection(0, CommandMode.POSITION) is None
    assert harness.driver.calls[-1] == ("end_stream", [0])


def test_a_claim_ends_when_the_image_shows_no_stop(
    harness: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = harness.driver.image

    def end_stream(axes: Sequence[int]) -> None:
        image.operation[list(axes)] = Operation.STOPPING
        harness.refresh()

    def sleep_until_ns(deadline_ns: int) -> None:
        image.operation[:] = Operation.IDLE
        harness.refresh()
        harness.clock.advance(0.002)

    monkeypatch.setattr(harness.driver, "end_stream", end_stream)
    monkeypatch.setattr(harness.clock, "sleep_until_ns", sleep_until_ns)
    with harness.axes.claimed("a goal", [0]):
        harness.refresh()
    assert harness.image.operation[0] == Operation.IDLE  # and the next goal can begin


def test_a_moving_axis_cannot_be_claimed(harness: Harness) -> None:
    harness.axes.move([Move(0, 0.5, PROFILE)])
    harness.refresh()
    with pytest.raises(NotReady, match="the test needs an idle axis, this one is in position"):
        harness.axes.claimed("the test", [1, 0]).__enter__()
    assert harness.axes.rejection(1, CommandMode.POSITION) is None


def test_axes_with_trajectories_on_the_device_are_claimed_and_not_streamed() -> None:
    harness = Harness(capabilities=ALL | {Capability.TRAJECTORIES_ON_DEVICE}).make_ready()
    with harness.axes.claimed("somebody", [0]):
        assert harness.axes.rejection(0, CommandMode.POSITION) is not None
    assert not any("stream" in str(call[0]) for call in harness.driver.calls)


def test_no_motion_starts_while_axes_are_kept_at_rest(harness: Harness) -> None:
    def is_locked() -> bool:
        locked: list[bool] = []
        lock = harness.axes._lock
        thread = threading.Thread(target=lambda: locked.append(not lock.acquire(blocking=False)))
        thread.start()
        thread.join()
        return locked[0]

    with harness.axes.kept_at_rest("writing an object"):
        assert is_locked()
        harness.axes.stop([0])
    assert not is_locked()


def test_axes_that_move_or_are_claimed_are_not_at_rest(harness: Harness) -> None:
    with (
        harness.axes.claimed("a goal", [1]),
        pytest.raises(NotReady, match=r"^joint2: in use by a goal$"),
        harness.axes.kept_at_rest("writing an object"),
    ):
        pass
    harness.driver.image.operation[2] = Operation.VELOCITY
    harness.refresh()
    text = r"^axis 2: writing an object needs an idle axis, this one is in velocity$"
    with pytest.raises(NotReady, match=text), harness.axes.kept_at_rest("writing an object"):
        pass
