"""No call holds up ``read`` or ``stream``, and none waits for a slow one. In real time.

Each kind of command is given several times next to a streaming axis. The longest ``read`` during
each of them counts, and of these the median: what holds a lock does so each time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Any

import numpy as np
import pytest

from robotd.api import AxisDriver, Capability, CommandMode, ProcessImage, RobotdError
from robotd_conformance.checks.harness import Harness, MakeHarness
from robotd_conformance.checks.stopwatch import timed
from robotd_conformance.checks.test_fieldbus import DEVICE_TYPE, HARMLESS
from robotd_conformance.checks.test_questions import rewrite
from robotd_conformance.checks.test_scaling import COUNTS, TURN

Call = Callable[[], object]
Calls = Callable[[Harness], Iterator[tuple[str, Call]]]

TIMES = 3  # that each call is made; the median counts
ATTEMPTS = 3  # a busy computer makes calls slower, never faster: the best attempt counts
CERTAIN = 5.0  # so many times the limit need no further attempt
HELD_S, HELD_PERIODS = 0.004, 1.5  # the longer one: a read that takes longer was held up
AT_ONCE_S, AT_ONCE_SHARE = 0.0015, 0.4  # or of a servo's time: a longer call has waited for it
ROUNDS = 7
BEGUN_S = 0.001  # after which a thread that was about to call a driver is in the call


@dataclass
class LoopCalls:
    """Calls of the control loop: when each began and ended, and how long it took of its own."""

    spans: list[tuple[float, float, float]] = field(default_factory=list)

    def watch(self, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return ``call`` with a record of its runs."""

        def watched(*arguments: Any) -> Any:
            durations, began_s = list[float](), time.perf_counter()
            try:
                with timed(durations):
                    return call(*arguments)
            finally:
                self.spans.append((began_s, time.perf_counter(), durations[0]))

        return watched

    def longest_s(self, began_s: float, ended_s: float) -> float:
        """Return the longest call that overlaps a time."""
        return max(
            (took for b, e, took in self.spans if e >= began_s and b <= ended_s), default=0.0
        )


@contextmanager
def watched_loop(harness: Harness) -> Iterator[LoopCalls]:
    """Note every ``read`` and ``stream`` in the block; the first axis streams where it can."""
    axes, loop = harness.drivers.axes, LoopCalls()
    read, stream = axes.read, axes.stream
    axes.read = loop.watch(read)  # type: ignore[method-assign]
    axes.stream = loop.watch(stream)  # type: ignore[method-assign]
    position, velocity = harness.image.position_command.copy(), np.zeros(harness.count)

    def send(image: ProcessImage) -> None:
        harness.stream(position, velocity)

    try:
        with harness.robot.axes.claimed("conformance", [0]), harness.each_period(send):
            harness.pass_time(0.05)
            yield loop
    finally:
        axes.read, axes.stream = read, stream  # type: ignore[method-assign]


def axis_calls(harness: Harness) -> Iterator[tuple[str, Call]]:
    """Yield the commands to the last axis, which the control loop's axis has nothing to do with."""
    axes, last = harness.drivers.axes, harness.count - 1
    here, travel = float(harness.image.position_command[last]), float(harness.travel(0.1)[last])
    profile = harness.profile(last, 0.3)
    yield "move", lambda: axes.move(last, here + travel, profile)
    yield "move", lambda: axes.move(last, here, profile)  # it overrides
    yield "stop", lambda: axes.stop([last])
    yield "quick_stop", lambda: axes.quick_stop([last])
    yield "servo", lambda: axes.servo(last, True, 5.0)
    yield "clear_alarm", lambda: axes.clear_alarm(last, 5.0)
    if harness.can(Capability.VELOCITY_MODE):
        slow = replace(profile, velocity=0.02 * float(np.sign(travel)))
        yield "set_command_mode", lambda: axes.set_command_mode(last, CommandMode.VELOCITY)
        yield "jog", lambda: axes.jog(last, slow)
        yield "jog", lambda: axes.jog(last, replace(slow, velocity=0.0))
        yield "set_command_mode", lambda: axes.set_command_mode(last, CommandMode.POSITION)
    if not harness.robot.axes.trajectories_on_device:
        yield "begin_stream", lambda: axes.begin_stream([last])
        yield "end_stream", lambda: axes.end_stream([last])
    if len(harness.servo_group(last)) == 1:
        yield "servo", lambda: axes.servo(last, False, 5.0)
        yield "servo", lambda: axes.servo(last, True, 5.0)


def other_calls(harness: Harness) -> Iterator[tuple[str, Call]]:
    """Yield calls of device, I/O and fieldbus that may come at any time."""
    device, io, bus = harness.drivers.device, harness.drivers.io, harness.drivers.fieldbus
    yield "open", device.open
    yield "start_communication", lambda: device.start_communication(5.0)
    yield "scan_network", device.scan_network
    yield "fault", device.fault
    if harness.can(Capability.PARAMETERS_FILE):
        yield "dump_parameters", lambda: device.dump_parameters(0)
    if io is not None and io.output_bytes:
        byte = io.output_bytes - 1
        data = io.read_outputs(byte, 1)
        yield "write_outputs", lambda: io.write_outputs(byte, data)
        yield "write_output_bit", lambda: io.write_output_bit(byte, 0, bool(data[0] & 1))
        yield "read_outputs", lambda: io.read_outputs(0, io.output_bytes)
        yield "read_inputs", lambda: io.read_inputs(0, io.input_bytes)
    if bus is None:
        return
    node = bus.node_ids(0)[-1]
    yield "status", lambda: bus.status(0)
    if harness.can(Capability.OBJECTS):
        yield "read_object", lambda: bus.read_object(0, node, DEVICE_TYPE, 0)
        yield "write_object", lambda: rewrite(bus, bus.node_ids(0)[0], HARMLESS[0])
    if harness.can(Capability.REGISTER_READ):
        yield "read_register", lambda: bus.read_register(0, node, 0, 8)
    if harness.can(Capability.STATISTICS):
        yield "reset_statistics", lambda: bus.reset_statistics(0)
    if harness.can(Capability.HOT_CONNECT):
        yield "start_hot_connect", lambda: bus.start_hot_connect(0)


def scale_calls(harness: Harness) -> Iterator[tuple[str, Call]]:
    """Yield the changes of the scale of the last axis; it is on afterwards, and at home."""
    axes, last = harness.drivers.axes, harness.count - 1
    yield "servo", lambda: axes.servo(last, False, 5.0)
    yield "set_polarity", lambda: axes.set_polarity(last, -1)
    yield "set_gear_ratio", lambda: axes.set_gear_ratio(last, COUNTS, TURN)
    yield "set_polarity", lambda: axes.set_polarity(last, 1)
    yield "servo", lambda: axes.servo(last, True, 5.0)
    if harness.can(Capability.HOMING):
        yield "home", lambda: axes.home(last, 10.0)


def held_up(harness: Harness, calls: Calls, limit_s: float) -> dict[str, float]:
    """Make every call ``TIMES``; return the waits of the control loop, s, that are too long."""
    held = dict[tuple[int, str], list[float]]()
    with watched_loop(harness) as loop:
        for _ in range(TIMES):
            for step, (name, call) in enumerate(calls(harness)):
                began_s = time.perf_counter()
                try:
                    call()
                except RobotdError:
                    continue  # an axis that stops may take no command
                ended_s = time.perf_counter()
                harness.periods(2)  # the read that the call has held up has ended
                held.setdefault((step, name), []).append(loop.longest_s(began_s, ended_s))
            harness.rest([harness.count - 1])
    waits = sorted((median(times), name) for (_, name), times in held.items())
    return {name: wait_s for wait_s, name in waits if wait_s > limit_s}


@pytest.mark.clause("drivers/timeouts", "drivers/loop", "AxisDriver.move/starts")
@pytest.mark.clause("AxisDriver.stream/setpoint")
@pytest.mark.parametrize("calls", [axis_calls, other_calls], ids=["axes", "others"])
def test_no_call_holds_up_the_control_loop(make_harness: MakeHarness, calls: Calls) -> None:
    harness = make_harness(real_time=True)
    harness.start()
    assert_free(harness, calls)


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("drivers/timeouts", "AxisDriver.set_polarity/sets", "AxisDriver.home/waits")
def test_no_change_of_scale_holds_up_the_control_loop(make_harness: MakeHarness) -> None:
    harness = make_harness(real_time=True)
    harness.start()
    harness.require_rescaling()
    if len(harness.servo_group(0)) > 1:
        pytest.skip("no servo is switched alone")
    assert_free(harness, scale_calls)


def assert_free(harness: Harness, calls: Calls) -> None:
    """Fail where each attempt finds calls during which the control loop waits."""
    if harness.count < 2:
        pytest.skip("there is one axis")
    limit_s, found = max(HELD_S, HELD_PERIODS * harness.period_s), dict[str, float]()
    for _ in range(ATTEMPTS):
        found = held_up(harness, calls, limit_s)
        if not found:
            return
        if max(found.values()) > CERTAIN * limit_s:
            break
    limit = f"the limit is {1e3 * limit_s:.1f} ms"
    raise AssertionError(
        "; ".join(
            f"{name} holds up the control loop for {1e3 * wait_s:.1f} ms, {limit}"
            for name, wait_s in found.items()
        )
    )


@pytest.mark.clause("drivers/threads", "AxisDriver.stop/returns", "AxisDriver.quick_stop/returns")
@pytest.mark.clause("DeviceDriver.state/blocks", "DeviceDriver.fault/blocks")
@pytest.mark.clause("IoDriver.read_inputs/blocks", "IoDriver.read_outputs/blocks")
def test_what_returns_at_once_waits_for_no_servo(make_harness: MakeHarness) -> None:
    """Stops, questions and I/O, while servos of another axis are switched all the time."""
    harness = make_harness(real_time=True)
    harness.start()
    axes, device, io = harness.drivers.axes, harness.drivers.device, harness.drivers.io
    last = harness.count - 1
    if last == 0 or len(harness.servo_group(last)) > 1:
        pytest.skip("no servo is switched alone")
    calls: dict[str, Call] = {
        "stop": lambda: axes.stop([0]),
        "quick_stop": lambda: axes.quick_stop([0]),
        "state": device.state,
        "fault": device.fault,
    }
    if io is not None and io.output_bytes and io.input_bytes:
        calls["read_outputs"] = lambda: io.read_outputs(0, io.output_bytes)
        calls["read_inputs"] = lambda: io.read_inputs(0, io.input_bytes)
    slow = [""]
    for _ in range(ATTEMPTS):
        if not (slow := waiting(harness, calls, last)):
            return
    raise AssertionError("; ".join(slow))


def waiting(harness: Harness, calls: dict[str, Call], axis: int) -> list[str]:
    """Return which of the ``calls`` wait while the servo of ``axis`` is switched."""
    with switching(harness, axis) as servo:
        waits = {name: servo.median_wait_s(call) for name, call in calls.items()}
    limit_s = max(AT_ONCE_S, AT_ONCE_SHARE * median(servo.durations_s))
    return [
        f"{name} waits {1e3 * wait_s:.1f} ms for a servo, the limit is {1e3 * limit_s:.1f} ms"
        for name, wait_s in waits.items()
        if wait_s > limit_s
    ]


class Switching:
    """A servo that a thread switches off and on all the time.

    Attributes:
        durations_s: how long each enabling took.
    """

    def __init__(self) -> None:
        self.durations_s = list[float]()
        self._enabling, self._ended = threading.Event(), threading.Event()

    def median_wait_s(self, call: Call) -> float:
        """Call ``ROUNDS`` times while the servo is being switched on; the median duration."""
        durations = list[float]()
        for _ in range(ROUNDS):
            self._enabling.clear()
            assert self._enabling.wait(20.0), "a servo is not switched any more"
            time.sleep(BEGUN_S)
            with timed(durations):
                call()
        return median(durations)

    def run(self, axes: AxisDriver, axis: int) -> None:
        """Switch until ``end``."""
        while not self._ended.is_set():
            with suppress(RobotdError):
                axes.servo(axis, False, 5.0)
                self._enabling.set()
                began_s = time.perf_counter()
                axes.servo(axis, True, 5.0)
                self.durations_s.append(time.perf_counter() - began_s)

    def end(self) -> None:
        self._ended.set()


@contextmanager
def switching(harness: Harness, axis: int) -> Iterator[Switching]:
    """Switch the servo of ``axis`` in a thread while the block runs."""
    servo = Switching()
    thread = threading.Thread(target=servo.run, args=(harness.drivers.axes, axis), name="caller")
    thread.start()
    try:
        yield servo
    finally:
        servo.end()
        thread.join(20.0)


@pytest.mark.clause("DeviceDriver.state/blocks", "DeviceDriver.fault/blocks")
def test_the_state_does_not_wait_for_a_start(make_harness: MakeHarness) -> None:
    """Asked all the time while the device is opened, starts to communicate, and stops."""
    harness = make_harness(real_time=True)
    harness.begin()
    device, slow = harness.drivers.device, [""]
    steps: dict[str, Call] = {
        "open": harness.open,
        "start_communication": lambda: device.start_communication(10.0),
        "stop_communication": lambda: device.stop_communication(10.0),
        "close": device.close,
    }
    for _ in range(ATTEMPTS):
        if not (slow := [text for name in steps for text in asked_during(harness, name, steps)]):
            return
    raise AssertionError("; ".join(slow))


def asked_during(harness: Harness, name: str, steps: dict[str, Call]) -> Iterator[str]:
    """Make a step while a thread asks for state and fault; yield which of them waited for it."""
    device, ended = harness.drivers.device, threading.Event()
    waits: dict[str, list[float]] = {"state": [0.0], "fault": [0.0]}

    def ask() -> None:
        while not ended.is_set():
            for question, call in (("state", device.state), ("fault", device.fault)):
                with timed(waits[question]):
                    call()
            time.sleep(0.0005)

    thread = threading.Thread(target=ask, name="caller")
    thread.start()
    began_s = time.perf_counter()
    try:
        steps[name]()
    finally:
        took_s = time.perf_counter() - began_s
        ended.set()
        thread.join(20.0)
    assert not thread.is_alive(), f"a question during {name} has not come back"
    limit_s = max(HELD_S, 0.5 * took_s)
    for question, times in waits.items():
        if max(times) > limit_s:
            yield f"{question} waits {1e3 * max(times):.1f} ms for {name} ({1e3 * took_s:.1f} ms)"
