"""Concurrent calls from several threads while the control loop runs. In real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from robotd.api import Capability, Operation, OperationError
from robotd_conformance.checks.harness import Harness, MakeHarness
from robotd_conformance.checks.stopwatch import timed
from robotd_conformance.checks.test_io import io_of, outputs

SECONDS = 1.0
BLOCKED_S = 0.02  # a read that takes longer was held up
BLOCKED_SHARE = 0.2  # of the time; a busy computer holds a read up now and then


def together(*works: Callable[[], None], seconds: float = SECONDS) -> None:
    """Repeat every work in its own thread for a while; none may raise."""
    errors: list[Exception] = []
    end_s = time.monotonic() + seconds

    def repeat(work: Callable[[], None]) -> None:
        try:
            while time.monotonic() < end_s and not errors:
                work()
        except Exception as error:  # noqa: BLE001 - the check looks at all of them
            errors.append(error)

    threads = [threading.Thread(target=repeat, args=(work,), name="caller") for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(seconds + 20.0)
    assert not any(thread.is_alive() for thread in threads), "a call has not come back"
    assert not errors


def start(make_harness: MakeHarness) -> tuple[Harness, list[float], list[str]]:
    """A harness in real time that records durations and errors of reads."""
    harness = make_harness(real_time=True)
    read, durations_s, failures = harness.drivers.axes.read, list[float](), list[str]()

    def watched(image: object) -> None:
        try:
            with timed(durations_s):
                read(image)  # type: ignore[arg-type]
        except Exception as error:
            failures.append(f"{type(error).__name__}: {error}")
            raise

    harness.drivers.axes.read = watched  # type: ignore[method-assign]
    harness.start()
    return harness, durations_s, failures


@pytest.mark.clause("drivers/timeouts", "AxisDriver.read/states")
@pytest.mark.clause("drivers/threads")
@pytest.mark.short_period
def test_commands_to_all_axes_at_once(make_harness: MakeHarness) -> None:
    harness, durations_s, failures = start(make_harness)
    home, travel = harness.image.position_command.copy(), harness.travel(0.3)
    counters = [0] * harness.count

    def command(axis: int) -> Callable[[], None]:
        def work() -> None:
            counters[axis] += 1
            harness.move([axis], home + counters[axis] % 2 * travel)
            time.sleep(0.01)
            if counters[axis] % 5 == 0:
                harness.robot.axes.stop([axis])
                harness.until(
                    lambda: harness.image.operation[axis] == Operation.IDLE, "a stop ends"
                )

        return work

    together(*(command(axis) for axis in harness.all[:4]), *observers(harness))
    assert not failures
    check_not_blocked(durations_s)
    harness.rest()
    harness.move(harness.all, home)
    harness.rest()
    assert not harness.off_target(home)


@pytest.mark.clause("drivers/threads", "AxisDriver.move/target", "AxisDriver.move/profile")
def test_moves_that_begin_at_once_keep_apart(make_harness: MakeHarness) -> None:
    """Each axis by a thread of its own, all at the same moment, with a target and a speed each."""
    harness = make_harness(real_time=True)
    harness.start()
    driver, home = harness.drivers.axes, harness.image.position_command.copy()
    profiles = [harness.profile(axis, 1.0 - 0.5 * axis / harness.count) for axis in harness.all]
    begin = threading.Barrier(harness.count)

    def move(axis: int, target: float) -> None:
        begin.wait(10.0)
        driver.move(axis, target, profiles[axis])

    with ThreadPoolExecutor(harness.count) as callers:
        for share in (0.3, 0.05, 0.2, 0.0) * 2:
            targets = home + harness.travel(share)
            list(callers.map(move, harness.all, targets.tolist()))
            harness.rest()
            assert not harness.off_target(targets)


@pytest.mark.clause("IoDriver.write_output_bit/bit", "drivers/threads")
def test_bits_written_at_once_are_all_there(make_harness: MakeHarness) -> None:
    """The bits of a byte, each by a thread of its own, all at the same moment."""
    harness = make_harness(real_time=True)
    io = io_of(harness)
    harness.start()
    byte, begin = io.output_bytes - 1, threading.Barrier(8)
    before = io.read_outputs(byte, 1)

    def write(bit: int, value: bool) -> None:
        begin.wait(10.0)
        io.write_output_bit(byte, bit, value)

    with ThreadPoolExecutor(8) as callers:
        for value in (True, False) * 5:
            list(callers.map(write, range(8), [value] * 8))
            outputs(harness, io, bytes([0xFF if value else 0x00]), byte)
    io.write_outputs(byte, before)


@pytest.mark.clause("drivers/threads", "drivers/timeouts")
def test_switching_servos_does_not_disturb_the_cycle(make_harness: MakeHarness) -> None:
    harness, durations_s, failures = start(make_harness)

    def switch(axis: int) -> Callable[[], None]:
        def work() -> None:
            harness.robot.axes.servo(axis, False)
            harness.robot.axes.clear_alarm(axis)
            harness.robot.axes.servo(axis, True)

        return work

    cycles = harness.robot.control_loop.stats.cycles
    # Of axes that share a switch one alone: an off of the others would end its on.
    alone = [axis for axis in harness.all if min(harness.robot.axes.servo_group(axis)) == axis]
    together(*(switch(axis) for axis in alone[:4]), *observers(harness))
    assert not failures
    check_not_blocked(durations_s)
    periods = harness.robot.control_loop.stats.cycles - cycles
    assert periods > 0.2 * SECONDS / harness.period_s, (
        f"commands held up the cycle: {periods} periods"
    )
    harness.until(lambda: bool(harness.image.servo_on.all()), "all servos are on at the end")


@pytest.mark.clause("drivers/threads")
def test_communication_may_stop_and_start_while_others_ask(make_harness: MakeHarness) -> None:
    harness, _, failures = start(make_harness)
    connection = harness.robot.connection

    def restart() -> None:
        connection.stop_communication()
        connection.start_communication()

    def ask() -> None:
        try:
            harness.robot.axes.clear_alarm(0)
        except OperationError:
            time.sleep(0.001)  # rejected while it is down: that is right

    together(restart, ask, *observers(harness), seconds=0.5)
    assert not failures
    harness.until(lambda: connection.ready, "the engine is ready at the end")


def check_not_blocked(durations_s: list[float]) -> None:
    blocked_s = sum(duration_s for duration_s in durations_s if duration_s > BLOCKED_S)
    assert blocked_s < BLOCKED_SHARE * SECONDS, f"commands held up the cycle for {blocked_s:.2f} s"


def observers(harness: Harness) -> list[Callable[[], None]]:
    """Return the calls that clients make all the time."""
    fieldbus, io = harness.drivers.fieldbus, harness.drivers.io

    def look() -> None:
        harness.drivers.device.state()
        harness.image.copy()
        time.sleep(0.001)

    def ask_fieldbus() -> None:
        assert fieldbus is not None
        fieldbus.status(0)
        time.sleep(0.005)

    def read_io() -> None:
        assert io is not None
        io.read_outputs(0, io.output_bytes)
        io.read_inputs(0, io.input_bytes)
        time.sleep(0.005)

    works = [look]
    if harness.can(Capability.FIELDBUS):
        works.append(ask_fieldbus)
    if harness.can(Capability.IO) and io is not None:
        works.append(read_io)
    return works
