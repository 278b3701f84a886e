"""An arm that was let go, at the driver of its axes: what ends that, and what holds it again."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo

from robotd.api import (
    DeviceContext,
    MonotonicClock,
    NotReady,
    RobotDescriptor,
    wait_until,
)
from robotd_feetech import robotd_axes, robotd_open_device
from robotd_feetech.options import FeetechOptions
from robotd_serial_servo.axes import ServoAxes
from robotd_serial_servo.device import ServoDevice
from robotd_serial_servo.options import ServoPlan

WAIT_S = 10.0
CATCH_NS = 300_000_000  # a servo is on before


@pytest.fixture
def bus() -> Iterator[StsBus]:
    servo = Servo(angle=0.3)
    servo.set("return_delay", 0)
    with StsBus({1: servo}, seed=1) as bus:
        yield bus


@pytest.fixture
def axes(bus: StsBus) -> Iterator[ServoAxes]:
    """The axis is guided by hand."""
    robot = RobotDescriptor.model_validate(
        {
            "schema": 1, "name": "arm", "backend": "feetech", "cycle": {"rate_hz": 100},
            "joints": [
                {
                    "name": "joint1", "axis": 0, "lower_rad": -2.5, "upper_rad": 2.5,
                    "velocity_rad_s": 2.0, "acceleration_rad_s2": 8.0,
                }
            ],
        }
    )  # fmt: skip
    options = FeetechOptions.model_validate(
        {"port": bus.port, "axes": [{"axis": 0, "servo": 1, "zero_tick": 2048}]}
        | {"reply_timeout_s": 0.2, "lost_after_s": 1.0}
    )
    context = DeviceContext[ServoPlan](robot, options.check_robot(robot))
    device = robotd_open_device(context)
    assert isinstance(device, ServoDevice)
    axes = robotd_axes(device, context)
    assert isinstance(axes, ServoAxes)
    _begin(device)
    axes.servo(0, True, WAIT_S)
    axes.let_go([0], WAIT_S)
    assert axes.is_let_go(0)
    yield axes
    device.close()


def _begin(device: ServoDevice) -> None:
    device.open()
    device.start_communication(WAIT_S)


def _lose_port(device: ServoDevice, bus: StsBus) -> None:
    bus.unplug()
    assert wait_until(lambda: "port lost" in device.fault(), WAIT_S, MonotonicClock())
    bus.plug_in()


def test_it_is_not_switched_on_while_it_is_guided(axes: ServoAxes) -> None:
    with pytest.raises(NotReady, match="guided by hand"):
        axes.servo(0, True, WAIT_S)


@pytest.mark.parametrize("end", ["lost", "lost while held again", "stopped", "closed", "off"])
def test_it_can_be_switched_on_after(axes: ServoAxes, bus: StsBus, end: str) -> None:
    device = axes._device
    if end == "lost while held again":
        axes.catch([0])
    if end.startswith("lost"):
        _lose_port(device, bus)
    elif end == "stopped":
        device.stop_communication(WAIT_S)
    elif end == "closed":
        device.close()
    else:
        axes.servo(0, False, WAIT_S)
    if end != "off":
        _begin(device)
    assert not axes.is_let_go(0)
    axes.servo(0, True, WAIT_S)
    assert bus[1].get("torque") == 1


@pytest.mark.parametrize("back", [False, True], ids=["stopped", "begun again"])
def test_a_late_stop_holds_nothing_after_the_end_of_communication(
    axes: ServoAxes, bus: StsBus, back: bool
) -> None:
    device = axes._device
    device.stop_communication(WAIT_S)
    if back:
        device.start_communication(WAIT_S)
    writes = len(bus[1].writes)
    axes.catch([0])
    exchange = device.connected
    began_ns = exchange.feedback.time_ns
    assert wait_until(
        lambda: exchange.feedback.time_ns > began_ns + CATCH_NS, WAIT_S, MonotonicClock()
    )
    assert len(bus[1].writes) == writes
    assert bus[1].get("torque") == 0
