"""Connection and parameters of a device that other threads use all the time. In real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from robotd.api import Capability, ConnectionState, DeviceTimeout, NotReady, RobotdError
from robotd_conformance.checks.harness import SETTLED_RAD, Harness, MakeHarness
from robotd_conformance.checks.test_connection import _parameters
from robotd_conformance.checks.test_parameters import (
    assert_changed,
    dumps,
    new_values,
    require_files,
    write,
)

ROUNDS = 3  # of each step: one may fall into a moment in which no other call runs
PAUSE_S = 0.001  # of a thread between two calls
IN_MOTION_S = 0.1
LOOK_S = 0.3  # for what happens by itself afterwards
TOO_SHORT_S = 0.001  # in which communication starts on a simulation at most
JOIN_S = 20.0

Call = Callable[[], object]


@contextmanager
def used(harness: Harness) -> Iterator[None]:
    """Call device, axes, I/O and fieldbus from a thread each while the block runs.

    A rejection is right. A call that has not come back in the end fails the check.
    """
    ended = threading.Event()

    def repeat(call: Call) -> None:
        while not ended.is_set():
            with suppress(RobotdError):
                call()
            time.sleep(PAUSE_S)

    threads = [
        threading.Thread(target=repeat, args=(call,), name="caller") for call in calls(harness)
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        ended.set()
        for thread in threads:
            thread.join(JOIN_S)
    assert not any(thread.is_alive() for thread in threads), "a call has not come back"


def calls(harness: Harness) -> list[Call]:
    """Return calls that change nothing on an axis without an alarm."""
    drivers, last = harness.drivers, harness.count - 1
    io, bus = drivers.io, drivers.fieldbus
    made: list[Call] = [
        lambda: (drivers.device.state(), drivers.device.fault()),
        drivers.device.scan_network,
        lambda: drivers.axes.clear_alarm(last, 1.0),
    ]
    if harness.can(Capability.PARAMETERS_FILE):
        made.append(lambda: drivers.device.dump_parameters(last))
    if bus is not None:
        made.append(lambda: bus.status(0))
    if io is not None:
        made.append(lambda: io.read_inputs(0, io.input_bytes))
        made.append(lambda: io.read_outputs(0, io.output_bytes))
    return made


def require_state(harness: Harness, state: ConnectionState, after: str) -> None:
    """Fail unless the device is in ``state``."""
    shown = harness.drivers.device.state()
    assert shown is state, f"the device is {shown.name} after {after}, not {state.name}"


@pytest.mark.clause("DeviceDriver.open/connects", "DeviceDriver.start_communication/starts")
@pytest.mark.clause("DeviceDriver.start_communication/nothing-moves")
@pytest.mark.clause("DeviceDriver.stop_communication/ends", "DeviceDriver.close/disconnects")
@pytest.mark.clause("DeviceDriver.stop_communication/axes-stop", "DeviceDriver.close/axes-stop")
@pytest.mark.parametrize("ending", ["stop_communication", "close"])
def test_connecting_works_while_others_call(make_harness: MakeHarness, ending: str) -> None:
    """Ended while all axes move; afterwards nothing is on and nothing moves."""
    harness = make_harness(real_time=True)
    device, connection = harness.drivers.device, harness.robot.connection
    harness.begin()
    with used(harness):
        for _ in range(ROUNDS):
            if device.state() is ConnectionState.IDLE:
                harness.open()
                require_state(harness, ConnectionState.RUNNING, "open")
            device.start_communication(10.0)
            require_state(harness, ConnectionState.COMMUNICATING, "start_communication")
            harness.start()
            harness.move_all()
            harness.pass_time(IN_MOTION_S)
            if ending == "close":
                device.close()
                require_state(harness, ConnectionState.IDLE, ending)
            else:
                device.stop_communication(10.0)
                require_state(harness, ConnectionState.RUNNING, ending)
            harness.until(lambda: not connection.ready, "the engine is not ready")
            harness.start(enable=False)
            assert_nothing_moves(harness, ending)


def assert_nothing_moves(harness: Harness, ended_by: str) -> None:
    """Fail where a servo is on, or an axis moves by itself, after communication began anew."""
    harness.rest()
    began = harness.image.position.copy()
    harness.pass_time(LOOK_S)
    on = np.flatnonzero(harness.image.servo_on).tolist()
    assert not on, f"after {ended_by} and a new start the servos of axes {on} are on"
    went = np.abs(harness.image.position - began)
    axis = int(went.argmax())
    assert went[axis] <= SETTLED_RAD, (
        f"axis {axis} has moved by {went[axis]:.4f} within {LOOK_S:g} s after {ended_by} and a new"
        f" start, the limit is {SETTLED_RAD:g}"
    )


@pytest.mark.clause("DeviceDriver.start_communication/resumes")
def test_a_lost_link_is_resumed_while_others_call(make_harness: MakeHarness) -> None:
    harness = make_harness(real_time=True)
    harness.start(enable=False)
    device, connection = harness.drivers.device, harness.robot.connection
    injector = harness.injector
    with used(harness):
        for _ in range(ROUNDS):
            injector.drop_communication()
            harness.until(lambda: not connection.ready, "the lost link is shown")
            harness.until(
                lambda: device.state() is not ConnectionState.UNKNOWN or connection.ready,
                "the device says whether communication can be resumed",
            )
            if device.state() is ConnectionState.RUNNING:
                device.start_communication(10.0)
                require_state(harness, ConnectionState.COMMUNICATING, "a lost link is resumed")
            harness.start(enable=False)


@pytest.mark.clause("DeviceDriver.stop_communication/undoes")
def test_a_start_is_undone_while_others_call(make_harness: MakeHarness) -> None:
    harness = make_harness(real_time=True)
    device = harness.drivers.device
    harness.begin()
    harness.open()
    with used(harness):
        for _ in range(ROUNDS):
            with suppress(DeviceTimeout):  # a device may be fast enough
                device.start_communication(TOO_SHORT_S)
            device.stop_communication(10.0)
            harness.pass_time(1.0)
            require_state(harness, ConnectionState.RUNNING, "a start that was undone, 1 s later,")


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("DeviceDriver.load_parameters/applies", "DeviceDriver.load_parameters/kept")
@pytest.mark.clause("DeviceDriver.load_parameters/note", "DeviceDriver.dump_parameters/scale")
def test_parameters_are_in_force_while_others_call(
    make_harness: MakeHarness, tmp_path: Path
) -> None:
    """Whole files and one with a part left out, in turn; then a change of the scale."""
    harness = make_harness(real_time=True)
    harness.start(enable=False)
    require_files(harness)
    device, axes, last = harness.drivers.device, harness.drivers.axes, harness.count - 1
    own = _parameters(harness)
    plain = write(own, tmp_path / "plain.xml")
    hard = write(own, tmp_path / "hard.xml", QuickStopDec=dict.fromkeys(harness.all, 21.5))
    lines = plain.read_text(encoding="utf-8").splitlines(keepends=True)
    short = tmp_path / "short.xml"
    short.write_text("".join(line for line in lines if "<QuickStopDec>" not in line), "utf-8")
    polarity = int(own["AxisPolarity"][last])
    device.load_parameters(plain)
    before = dumps(harness)
    with used(harness):
        for _ in range(ROUNDS):
            note = device.load_parameters(hard)
            assert not note.strip(), f"the note on a whole file is {note!r}"
            assert_changed(before, dumps(harness), harness.all, "the file")
            harness.pass_time(LOOK_S)
            assert_changed(before, dumps(harness), harness.all, f"the file, {LOOK_S:g} s later")
            assert device.load_parameters(short).strip(), "no note on what a file leaves out"
            device.load_parameters(plain)
            assert_changed(before, dumps(harness), [], "the first file again")
            axes.set_polarity(last, -polarity)
            assert_changed(before, dumps(harness), [last], "polarity of the last axis")
            axes.set_polarity(last, polarity)
            assert_changed(before, dumps(harness), [], "the polarity as before")


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("DeviceDriver.load_parameters/live", "DeviceDriver.load_parameters/named")
def test_a_live_axis_keeps_its_scale_while_others_call(
    make_harness: MakeHarness, tmp_path: Path
) -> None:
    harness = make_harness(real_time=True)
    harness.start()
    require_files(harness)
    harness.disable()
    device, own, last = harness.drivers.device, _parameters(harness), harness.count - 1
    turned = write(own, tmp_path / "turned.xml", **new_values(harness, own))
    device.load_parameters(write(own, tmp_path / "own.xml"))
    before = dumps(harness)
    harness.robot.axes.servo(last, True)
    with used(harness):
        for _ in range(ROUNDS):
            with pytest.raises(NotReady, match=rf"\b{last}\b"):
                device.load_parameters(turned)
            assert_changed(before, dumps(harness), [], f"a file rejected for axis {last}")
