"""Concurrent calls from several threads while the cycle runs. In real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from robotd.device.capabilities import Capability
from robotd.device.state import Operation
from robotd.errors import OperationError
from robotd.testing.conformance.rig import SETTLED_RAD, MakeRig, Rig
from robotd.testing.conformance.stopwatch import timed

SECONDS = 1.0
BLOCKED_S = 0.02  # a read that takes longer was held up
BLOCKED_SHARE = 0.2  # of the time; a busy computer holds a read up now and then


def together(*works: Callable[[], None], seconds: float = SECONDS) -> list[BaseException]:
    """Repeat every work in a thread of its own for a while; what they raised."""
    errors: list[BaseException] = []
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
    return errors


def start(make_rig: MakeRig) -> tuple[Rig, list[float], list[str]]:
    """A rig in real time whose reads are watched: durations, and what they raised."""
    rig = make_rig(real_time=True)
    read, durations_s, failures = rig.parts.driver.read, list[float](), list[str]()

    def watched(image: object) -> None:
        try:
            with timed(durations_s):
                read(image)  # type: ignore[arg-type]
        except Exception as error:
            failures.append(f"{type(error).__name__}: {error}")
            raise

    rig.parts.driver.read = watched  # type: ignore[method-assign]
    rig.up()
    return rig, durations_s, failures


def test_commands_to_all_axes_at_once(make_rig: MakeRig) -> None:
    rig, durations_s, failures = start(make_rig)
    home, travel = rig.image.position_command.copy(), rig.travel(0.3)
    counters = [0] * rig.count

    def command(axis: int) -> Callable[[], None]:
        def work() -> None:
            counters[axis] += 1
            sign = 1.0 if counters[axis] % 2 else -1.0
            rig.move([axis], home + sign * travel)
            time.sleep(0.01)
            if counters[axis] % 5 == 0:
                rig.robot.axes.stop([axis])
                rig.until(lambda: rig.image.operation[axis] == Operation.IDLE, "a stop ends")

        return work

    errors = together(*(command(axis) for axis in rig.all[:4]), *observers(rig))
    assert not errors
    assert not failures
    check_not_blocked(durations_s)
    rig.rest()
    rig.move(rig.all, home)
    rig.rest()
    assert np.abs(rig.image.position - home).max() <= SETTLED_RAD


def test_switching_servos_does_not_disturb_the_cycle(make_rig: MakeRig) -> None:
    rig, durations_s, failures = start(make_rig)

    def switch(axis: int) -> Callable[[], None]:
        def work() -> None:
            rig.robot.axes.servo(axis, False)
            rig.robot.axes.clear_alarm(axis)
            rig.robot.axes.servo(axis, True)

        return work

    cycles = rig.robot.cycle.stats.cycles
    errors = together(*(switch(axis) for axis in rig.all[:4]), *observers(rig))
    assert not errors
    assert not failures
    check_not_blocked(durations_s)
    periods = rig.robot.cycle.stats.cycles - cycles
    assert periods > 0.2 * SECONDS / rig.period_s, f"commands held up the cycle: {periods} periods"
    rig.until(lambda: bool(rig.image.servo_on.all()), "all servos are on at the end")


def test_communication_may_stop_and_start_while_others_ask(make_rig: MakeRig) -> None:
    rig, _, failures = start(make_rig)
    engine = rig.robot.engine

    def restart() -> None:
        engine.stop_communication()
        engine.start_communication()

    def ask() -> None:
        try:
            rig.robot.axes.clear_alarm(0)
        except OperationError:
            time.sleep(0.001)  # refused while it is down: that is right

    errors = together(restart, ask, *observers(rig), seconds=0.5)
    assert not errors
    assert not failures
    rig.until(lambda: engine.ready, "the engine is ready at the end")


def check_not_blocked(durations_s: list[float]) -> None:
    blocked_s = sum(duration_s for duration_s in durations_s if duration_s > BLOCKED_S)
    assert blocked_s < BLOCKED_SHARE * SECONDS, f"commands held up the cycle for {blocked_s:.2f} s"


def observers(rig: Rig) -> list[Callable[[], None]]:
    """What clients ask for all the time."""
    works: list[Callable[[], None]] = [lambda: look(rig)]
    if rig.can(Capability.FIELDBUS):
        works.append(lambda: ask_fieldbus(rig))
    if rig.can(Capability.IO) and rig.parts.io_driver is not None:
        works.append(lambda: read_io(rig))
    return works


def look(rig: Rig) -> None:
    rig.parts.device.state()
    rig.image.copy()
    time.sleep(0.001)


def ask_fieldbus(rig: Rig) -> None:
    driver = rig.parts.fieldbus_driver
    assert driver is not None
    driver.network_state(0)
    time.sleep(0.005)


def read_io(rig: Rig) -> None:
    driver = rig.parts.io_driver
    assert driver is not None
    driver.read_outputs(0, driver.output_bytes)
    driver.read_inputs(0, driver.input_bytes)
    time.sleep(0.005)
