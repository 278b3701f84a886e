"""States and their transitions; start-up and shut-down in any order, and twice."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from robotd.api import Capability, ConnectionState, NotReady, ProcessImage, RobotdError
from robotd_conformance.checks.harness import SETTLED_RAD, Harness
from robotd_wmx_parameters import (
    WmxParameters,
    default_wmx_parameters,
    read_wmx_parameters,
    write_wmx_parameters,
)

SETTLED_PERIODS = 50  # after which positions are measured, whatever was shown first


@pytest.mark.clause("DeviceDriver.state/now")
def test_a_device_that_is_made_is_idle(unopened: Harness) -> None:
    assert unopened.drivers.device.state() is ConnectionState.IDLE


@pytest.mark.clause(
    "DeviceDriver.start_communication/starts", "DeviceDriver.stop_communication/ends"
)
@pytest.mark.clause("DeviceDriver.state/now")
def test_the_states_follow_the_calls(unopened: Harness) -> None:
    device = unopened.drivers.device
    unopened.begin()
    seen = []
    calls: list[Callable[[], None]] = [
        unopened.open,
        lambda: device.start_communication(10.0),
        lambda: device.stop_communication(10.0),
        lambda: device.start_communication(10.0),
        device.close,
    ]
    for call in calls:
        call()
        seen.append(device.state().name)
    assert seen == ["RUNNING", "COMMUNICATING", "RUNNING", "COMMUNICATING", "IDLE"]


@pytest.mark.clause("DeviceDriver.open/again")
def test_every_call_may_come_twice(unopened: Harness) -> None:
    connection = unopened.robot.connection
    for call, state in (
        (connection.open, ConnectionState.RUNNING),
        (connection.start_communication, ConnectionState.COMMUNICATING),
        (connection.stop_communication, ConnectionState.RUNNING),
        (connection.close, ConnectionState.IDLE),
        (connection.shutdown, ConnectionState.SHUTDOWN),
    ):
        call()
        call()
        assert connection.state is state


@pytest.mark.clause("DeviceDriver.close/twice")
def test_closing_a_device_twice_or_unopened_is_no_error(unopened: Harness) -> None:
    device = unopened.drivers.device
    device.close()
    device.open()
    device.close()
    device.close()
    assert device.state() is ConnectionState.IDLE


@pytest.mark.clause("DeviceDriver.start_communication/starts")
def test_calls_out_of_order_are_rejected_or_have_no_effect(unopened: Harness) -> None:
    connection = unopened.robot.connection
    with pytest.raises(NotReady):
        connection.start_communication()
    with pytest.raises(NotReady):
        connection.scan_network()
    connection.stop_communication()
    connection.close()
    assert connection.state is ConnectionState.IDLE


@pytest.mark.clause("DeviceDriver.start_communication/starts", "drivers/rejects")
def test_communication_without_an_open_device_is_rejected(unopened: Harness) -> None:
    device = unopened.drivers.device
    with pytest.raises(RobotdError):
        device.start_communication(1.0)
    assert device.state() is ConnectionState.IDLE


@pytest.mark.clause("DeviceDriver.open/connects")
def test_it_works_again_after_it_was_closed(unopened: Harness) -> None:
    for _ in range(2):
        unopened.start()
        targets = unopened.move_all(0.3)
        unopened.rest()
        assert not unopened.off_target(targets)
        unopened.robot.connection.close()
        unopened.until(
            lambda: not unopened.robot.connection.ready, "the engine is not ready once it is closed"
        )


@pytest.mark.clause("DeviceDriver.start_communication/nothing-moves")
def test_starting_enables_and_moves_nothing(disabled: Harness) -> None:
    start = disabled.image.position.copy()
    disabled.pass_time(0.3)
    assert not disabled.image.servo_on.any()
    assert np.abs(disabled.image.position - start).max() <= SETTLED_RAD


@pytest.mark.clause("DeviceDriver.stop_communication/undoes")
def test_a_start_that_times_out_is_undone(unopened: Harness) -> None:
    unopened.begin()
    connection = unopened.robot.connection
    settings = connection.settings
    connection.settings = settings.model_copy(update={"communication_timeout_s": 0.001})
    connection.open()
    try:
        connection.start_communication()
    except RobotdError:
        unopened.pass_time(1.0)
        late = unopened.drivers.device.state()
        assert late is ConnectionState.RUNNING, f"{late.value} after a start that failed"
    connection.settings = settings
    connection.start_communication()
    unopened.until(lambda: connection.ready, "the engine is ready")


@pytest.mark.clause("DeviceDriver.stop_communication/axes-stop")
@pytest.mark.clause("AxisDriver/servos")
def test_servos_are_off_after_communication_stopped(fresh: Harness) -> None:
    fresh.drivers.device.stop_communication(10.0)
    fresh.periods(3)
    fresh.robot.connection.start_communication()
    fresh.until(lambda: fresh.robot.connection.ready, "the engine is ready again")
    fresh.pass_time(0.3)
    assert not fresh.image.servo_on.any(), "nothing may enable a servo by itself"


@pytest.mark.clause("DeviceDriver.start_communication/starts")
@pytest.mark.clause("AxisDriver.read/measured")
def test_the_first_position_of_a_connection_is_measured(fresh: Harness) -> None:
    """The position that an axis shows first becomes the command of its servo."""
    fresh.move_all(0.5)
    fresh.rest()
    fresh.disable()
    fresh.rest()
    fresh.robot.connection.stop_communication()
    fresh.until(lambda: bool(np.isnan(fresh.image.position).all()), "positions are forgotten")
    if fresh.fault_injector is not None:
        for axis, delta in zip(fresh.all, fresh.travel(0.25), strict=True):
            with suppress(RobotdError):  # not every simulation can be turned without power
                fresh.fault_injector.move_by_hand(axis, float(delta))
    first = np.full(fresh.count, np.nan)

    def note(image: ProcessImage) -> None:
        shown = np.isnan(first) & np.isfinite(image.position) & ~image.offline
        first[shown] = image.position[shown]

    with fresh.each_period(note):
        fresh.robot.connection.start_communication()
        fresh.until(lambda: bool(np.isfinite(first).all()), "positions are known")
        fresh.periods(SETTLED_PERIODS)
    assert first == pytest.approx(fresh.image.position, abs=SETTLED_RAD)


@pytest.mark.clause("DeviceDriver.close/disconnects")
def test_closing_while_axes_move_is_orderly(fresh: Harness) -> None:
    fresh.move_all()
    fresh.pass_time(0.15)
    fresh.robot.shutdown()
    assert fresh.robot.connection.state is ConnectionState.SHUTDOWN
    assert fresh.drivers.device.state() is ConnectionState.IDLE


@pytest.mark.clause("DeviceDriver.scan_network/summary")
def test_a_scan_is_one_line_for_people(harness: Harness) -> None:
    line = harness.robot.connection.scan_network()
    assert line.strip()
    assert "\n" not in line


@pytest.mark.clause("DeviceDriver.dump_parameters/text")
@pytest.mark.needs(Capability.PARAMETERS_FILE)
def test_parameters_can_be_shown_for_every_axis(harness: Harness) -> None:
    for axis in harness.all:
        assert harness.robot.connection.dump_parameters(axis).strip()


@pytest.mark.clause("DeviceDriver.load_parameters/wrong-file")
@pytest.mark.needs(Capability.PARAMETERS_FILE)
def test_a_bad_parameter_file_changes_nothing(harness: Harness, tmp_path: Path) -> None:
    bad = tmp_path / "parameters.xml"
    bad.write_text("<Parameters><not closed", encoding="utf-8")
    before = [harness.robot.connection.dump_parameters(axis) for axis in harness.all]
    with pytest.raises(RobotdError):
        harness.robot.connection.load_parameters(bad)
    assert [harness.robot.connection.dump_parameters(axis) for axis in harness.all] == before


@pytest.mark.clause("DeviceDriver.load_parameters/live")
@pytest.mark.needs(Capability.PARAMETERS_FILE)
def test_a_load_changes_no_scale_of_a_live_axis(harness: Harness, tmp_path: Path) -> None:
    parameters = _parameters(harness)
    polarity = -int(parameters["AxisPolarity"][0])
    path = tmp_path / "parameters.xml"
    write_wmx_parameters(parameters.with_values({"AxisPolarity": {0: polarity}}), path)
    before = [harness.robot.connection.dump_parameters(axis) for axis in harness.all]
    where = harness.image.position.copy()
    assert harness.image.servo_on.all()
    with pytest.raises(RobotdError):
        harness.robot.connection.load_parameters(path)
    assert [harness.robot.connection.dump_parameters(axis) for axis in harness.all] == before
    harness.pass_time(0.2)
    assert np.abs(harness.image.position - where).max() <= SETTLED_RAD
    assert harness.image.servo_on.all()


def _parameters(harness: Harness) -> WmxParameters:
    """The robot's own, or the vendor's defaults for one that has none."""
    path = harness.robot.descriptor.parameters_file
    return default_wmx_parameters() if path is None else read_wmx_parameters(path)


@pytest.mark.clause("DeviceDriver.load_parameters/applies", "DeviceDriver.dump_parameters/text")
@pytest.mark.needs(Capability.PARAMETERS_FILE)
def test_a_good_parameter_file_is_in_force_axis_by_axis(disabled: Harness, tmp_path: Path) -> None:
    disabled.require_rescaling()
    if disabled.count < 2:
        pytest.skip("there is one axis")
    ramps = {axis: 1.5 + axis for axis in disabled.all}
    parameters = default_wmx_parameters().with_values({"QuickStopDec": ramps})
    path = tmp_path / "good.xml"
    write_wmx_parameters(parameters, path)
    before = [disabled.robot.connection.dump_parameters(axis) for axis in disabled.all]
    disabled.robot.connection.load_parameters(path)
    after = [disabled.robot.connection.dump_parameters(axis) for axis in disabled.all]
    assert all(one != other for one, other in zip(before, after, strict=True)), "nothing changed"
    assert after[0] != after[1], "two axes with different parameters have the same dump"


@pytest.mark.needs(Capability.SCALING)
@pytest.mark.clause("DeviceDriver.load_parameters/applies", "DeviceDriver.dump_parameters/text")
def test_loaded_parameters_are_in_force(rescalable: Harness, tmp_path: Path) -> None:
    """The polarity of one axis after the other turns the position of that axis."""
    if not rescalable.can(Capability.PARAMETERS_FILE):
        pytest.skip("the device takes no parameter file")
    plain = _parameters(rescalable).with_values({"AxisPolarity": dict.fromkeys(rescalable.all, 1)})
    path, device = tmp_path / "parameters.xml", rescalable.robot.connection
    write_wmx_parameters(plain, path)
    device.load_parameters(path)
    rescalable.periods(5)
    before = rescalable.image.position.copy()
    texts = [device.dump_parameters(axis) for axis in rescalable.all]
    for turned in (0, rescalable.count - 1):
        write_wmx_parameters(plain.with_values({"AxisPolarity": {turned: -1}}), path)
        device.load_parameters(path)
        rescalable.periods(5)
        expected = before.copy()
        expected[turned] *= -1.0
        assert rescalable.image.position == pytest.approx(expected, abs=SETTLED_RAD)
        for axis in rescalable.all:
            same = device.dump_parameters(axis) == texts[axis]
            assert same == (axis != turned), f"the dump of axis {axis}"
