"""When commands were sent, by the clocks of the middleware, of ROS and of the control loop."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import pytest

from robotd.clock import NANOSECONDS, MonotonicClock
from robotd.errors import InvalidArgument
from robotd_ros.nodes.command_subscription import CommandTimes, header_stamp_ns

TIMEOUT_S = 0.5
SIMULATED_NS = 100 * NANOSECONDS


class StandingClock:
    """Simulated clock of a control loop."""

    def now_ns(self) -> int:
        return 7 * NANOSECONDS

    def sleep_until_ns(self, deadline_ns: int) -> None: ...


def times(*, real: bool = True, follows_topic: bool = False) -> CommandTimes:
    def now() -> Any:
        return SimpleNamespace(nanoseconds=SIMULATED_NS if follows_topic else time.time_ns())

    ros_clock = SimpleNamespace(ros_time_is_active=follows_topic, now=now)
    node: Any = SimpleNamespace(get_clock=lambda: ros_clock)
    return CommandTimes(node, MonotonicClock() if real else StandingClock())


def ago(seconds: float) -> int:
    return time.time_ns() - round(seconds * NANOSECONDS)


def age_s(sent_ns: int) -> float:
    return (time.monotonic_ns() - sent_ns) / NANOSECONDS


@pytest.mark.parametrize(
    ("source_ago_s", "stamp_ago_s", "expected_s"),
    [
        (0.0, None, 0.0),
        (0.3, None, 0.3),
        (-0.3, None, 0.0),  # a clock that is a little ahead: now
        (0.0, 0.3, 0.3),
        (0.3, 0.1, 0.3),  # the older of the two
        (0.3, -0.2, 0.3),
    ],
)
def test_the_time_of_sending(
    source_ago_s: float, stamp_ago_s: float | None, expected_s: float
) -> None:
    stamp_ns = 0 if stamp_ago_s is None else ago(stamp_ago_s)
    sent_ns = times().sent_ns(ago(source_ago_s), stamp_ns, TIMEOUT_S)
    assert age_s(sent_ns) == pytest.approx(expected_s, abs=0.1)


def test_a_middleware_that_knows_no_time() -> None:
    assert age_s(times().sent_ns(0, 0, TIMEOUT_S)) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("stamped", [False, True], ids=["source", "stamp"])
@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (12.3, "is 12.3 s older than this computer's clock: commands late by more than 0.5 s"),
        (-12.3, "is 12.3 s ahead of this computer's clock: commands ahead by more than 0.5 s"),
    ],
)
def test_commands_of_another_time_are_rejected(seconds: float, text: str, stamped: bool) -> None:
    stamp_ns, source_ns = (ago(seconds), ago(0.0)) if stamped else (0, ago(seconds))
    with pytest.raises(InvalidArgument) as error:
        times().sent_ns(source_ns, stamp_ns, TIMEOUT_S)
    assert text in str(error.value)
    assert "are the clocks of both computers in step (chrony, ptp)?" in str(error.value)


def test_stamps_of_simulated_time_are_judged_by_it_and_the_source_by_the_system() -> None:
    judged = times(follows_topic=True)
    stamp_ns = SIMULATED_NS - NANOSECONDS // 5
    # Seconds of /clock are not those of the control loop.
    assert age_s(judged.sent_ns(ago(0.1), stamp_ns, TIMEOUT_S)) == pytest.approx(0.1, abs=0.05)
    with pytest.raises(InvalidArgument, match=r"ahead of the time of /clock.*use_sim_time"):
        judged.sent_ns(ago(0.0), ago(0.0), TIMEOUT_S)
    with pytest.raises(InvalidArgument, match="older than this computer's clock"):
        judged.sent_ns(ago(3.0), stamp_ns, TIMEOUT_S)  # /clock was held meanwhile


def test_a_simulated_control_loop_counts_the_age_of_stamps_in_its_own_time() -> None:
    judged, now_ns = times(real=False, follows_topic=True), 7 * NANOSECONDS
    assert judged.sent_ns(ago(0.4), 0, TIMEOUT_S) == now_ns
    stamp_ns = SIMULATED_NS - NANOSECONDS // 5
    assert judged.sent_ns(ago(0.4), stamp_ns, TIMEOUT_S) == now_ns - NANOSECONDS // 5
    with pytest.raises(InvalidArgument, match="older than this computer's clock"):
        judged.sent_ns(ago(0.6), stamp_ns, TIMEOUT_S)


def test_messages_without_a_header_say_no_time() -> None:
    stamp = SimpleNamespace(sec=2, nanosec=5)
    assert header_stamp_ns(SimpleNamespace()) == 0
    assert header_stamp_ns(SimpleNamespace(header=SimpleNamespace(stamp=stamp))) == 2_000_000_005
