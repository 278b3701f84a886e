"""Rejections: by robotd's errors, with the reason, and nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import pytest

from robotd.api import (
    BackendInfo,
    Capability,
    CommandMode,
    DescriptorError,
    OperationError,
    Profile,
    Unsupported,
)
from robotd.api.robots import Jog, Robot
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.kit_target import KitTarget

FEATURES = MappingProxyType[Capability, Callable[[Robot], object]]({
    Capability.VELOCITY_MODE: lambda robot: robot.axes.set_command_mode(0, CommandMode.VELOCITY),
    Capability.TORQUE_MODE: lambda robot: robot.axes.set_command_mode(0, CommandMode.TORQUE),
    Capability.HOMING: lambda robot: robot.axes.home(0),
    Capability.SCALING: lambda robot: robot.axes.set_polarity(0, 1),
    Capability.PARAMETERS_FILE: lambda robot: robot.connection.dump_parameters(0),
    Capability.IO: lambda robot: robot.io.output_bytes(0, 1),
    Capability.FIELDBUS: lambda robot: robot.fieldbus.status(0),
    Capability.PAYLOAD: lambda robot: robot.payload.current(),
    Capability.REGISTER_READ: lambda robot: robot.fieldbus.read_register(0, 0, 0, 1),
    Capability.STATISTICS: lambda robot: robot.fieldbus.reset_statistics(0),
    Capability.HOT_CONNECT: lambda robot: robot.fieldbus.start_hot_connect(0),
})  # fmt: skip

MODES = {
    CommandMode.VELOCITY: Capability.VELOCITY_MODE,
    CommandMode.TORQUE: Capability.TORQUE_MODE,
}

KEEPS_WHAT_IT_FINDS = (
    Capability.PARAMETERS_FILE,
    Capability.IO,
    Capability.FIELDBUS,
    Capability.PAYLOAD,
    Capability.REGISTER_READ,
    Capability.STATISTICS,
    Capability.HOT_CONNECT,
)


@pytest.mark.clause("backend/declares")
def test_the_backend_describes_itself(target: KitTarget) -> None:
    info = target.backend.info
    assert isinstance(info, BackendInfo)
    assert info.summary.strip()
    assert "\n" not in info.summary


@pytest.mark.clause("backend/declares")
def test_an_unknown_option_is_rejected(target: KitTarget) -> None:
    section = {"no_such_option_of_any_backend": 1}
    changed = target.descriptor.model_copy(update={"backends": {target.backend.name: section}})
    with pytest.raises(DescriptorError, match="no_such_option_of_any_backend"):
        target.backend.context(changed)


@pytest.mark.clause("backend/declares", "AxisDriver.lacking/lacks")
def test_what_is_not_declared_is_not_supported(harness: Harness) -> None:
    for capability, use in FEATURES.items():
        if not harness.can(capability):
            with pytest.raises(Unsupported, match="not supported by the"):
                use(harness.robot)


@pytest.mark.clause("AxisDriver.set_command_mode/undeclared")
def test_the_driver_takes_no_mode_that_is_not_declared(harness: Harness) -> None:
    modes = [mode for mode, capability in MODES.items() if not harness.can(capability)]
    if not modes:
        pytest.skip("the device has all modes")
    for mode in modes:
        for axis in {0, harness.count - 1}:
            with pytest.raises(Unsupported):
                harness.drivers.axes.set_command_mode(axis, mode)
    harness.periods(5)
    assert (harness.image.mode == CommandMode.POSITION).all()


@pytest.mark.clause("backend/declares")
def test_what_is_declared_is_there(harness: Harness) -> None:
    for capability in KEEPS_WHAT_IT_FINDS:
        if harness.can(capability):
            FEATURES[capability](harness.robot)


@pytest.mark.clause("drivers/rejects")
def test_values_outside_are_rejected_before_the_driver_sees_them(harness: Harness) -> None:
    axes, start = harness.robot.axes, harness.image.position.copy()
    nan = float("nan")
    calls: list[Callable[[], object]] = [
        lambda: axes.servo(harness.count, True),
        lambda: axes.servo(-1, True),
        lambda: axes.set_command_mode(0, 7),
        lambda: harness.move([0], start + nan),
        lambda: harness.move([0, 0], start),
        lambda: axes.jog([Jog(harness.count, Profile(0.1, 1.0, 1.0))]),
    ]
    for call in calls:
        with pytest.raises(OperationError):
            call()
    harness.pass_time(0.1)
    assert harness.image.position == pytest.approx(start, abs=1e-3)


@pytest.mark.clause("drivers/rejects", "drivers/errors")
def test_a_driver_without_communication_refuses_by_robotds_errors(unopened: Harness) -> None:
    driver = unopened.drivers.axes
    unopened.drivers.device.open()
    profile = Profile(0.5, 2.0, 2.0)
    calls: list[Callable[[], object]] = [
        lambda: driver.servo(0, True, 0.5),
        lambda: driver.move(0, 0.1, profile),
        lambda: driver.jog(0, profile),
        lambda: driver.begin_stream([0]),
    ]
    for call in calls:
        with pytest.raises((OperationError, TimeoutError)):
            call()


@pytest.mark.clause("drivers/rejects")
@pytest.mark.needs(Capability.VELOCITY_MODE)
def test_an_axis_in_position_mode_takes_no_velocity(harness: Harness) -> None:
    with pytest.raises(OperationError):
        harness.robot.axes.jog([Jog(0, Profile(0.1, 1.0, 1.0))])
