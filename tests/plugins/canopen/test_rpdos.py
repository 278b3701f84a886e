"""RPDOs are sent in the modes of operation in which they matter."""

from __future__ import annotations

from typing import Any

import pytest
from tests.fakes import FakeClock
from tests.plugins.canopen.network import drive, options, plan

from robotd.descriptor import RobotDescriptor
from robotd.errors import DescriptorError
from robotd_canopen.frame import Frame
from robotd_canopen.master import Master
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import MODE, OUTPUTS

CONTROL = ["0x6040", "0x6060"]
POSITION, VELOCITY, TORQUE = "0x607A", "0x60FF", "0x6071"


class SentFrames:
    """Stand-in for a bus: keeps what is sent."""

    def __init__(self) -> None:
        self.cob_ids: list[int] = []

    def send(self, frame: Frame) -> None:
        self.cob_ids.append(frame.arbitration_id)


def sent(mode: OperationMode, *mappings: list[str], **keys: Any) -> list[int]:
    """Return the numbers of the RPDOs that are sent in ``mode``."""
    rpdos = [{"number": number, "objects": entries} for number, entries in enumerate(mappings, 1)]
    layout = plan(options(axes=[drive(0, rpdos=rpdos, **keys), drive(1)]))
    robot = RobotDescriptor.model_validate({"schema": 1, "name": "test", "axes": 2})
    axis, bus = Master(robot, layout, FakeClock()).axes[0], SentFrames()
    axis.drive._bus = bus  # type: ignore[assignment]
    axis.drive.node.configured = True
    axis.drive.put([mode if index == MODE else 0 for index in OUTPUTS])
    return [(cob_id - 0x100) // 0x100 for cob_id in bus.cob_ids]


@pytest.mark.parametrize(
    ("mode", "mappings", "numbers"),
    [
        ("CYCLIC_POSITION", (CONTROL, [POSITION]), [1, 2]),
        ("CYCLIC_POSITION", (CONTROL, [POSITION, VELOCITY]), [1, 2]),
        ("PROFILE_POSITION", (CONTROL, [POSITION, VELOCITY]), [1, 2]),
        ("PROFILE_VELOCITY", (CONTROL, [POSITION, VELOCITY]), [1, 2]),
        ("PROFILE_VELOCITY", (CONTROL, [POSITION], [VELOCITY]), [1, 3]),
        ("CYCLIC_TORQUE", ([*CONTROL, POSITION], [VELOCITY, TORQUE]), [1, 2]),
        ("CYCLIC_TORQUE", (CONTROL, [POSITION], [VELOCITY]), [1]),
        ("HOMING", (CONTROL, [POSITION], [VELOCITY]), [1]),
    ],
)
def test_an_rpdo_is_sent_where_one_of_its_objects_matters(
    mode: str, mappings: tuple[list[str], ...], numbers: list[int]
) -> None:
    assert sent(OperationMode[mode], *mappings) == numbers


def test_interpolation_data_have_an_rpdo_of_their_own() -> None:
    mappings = [*CONTROL], ["0x60C1:1"], [POSITION]
    interpolated = sent(OperationMode.INTERPOLATED_POSITION, *mappings, stream_mode="ip")
    assert interpolated == [1, 2]
    assert sent(OperationMode.PROFILE_POSITION, *mappings, stream_mode="ip") == [1, 3]


@pytest.mark.parametrize(
    ("stream_mode", "mappings", "missing"),
    [
        ("csp", (CONTROL, [VELOCITY]), "0x607A"),
        ("ip", (CONTROL, [POSITION]), "0x60C1"),
    ],
)
def test_a_mapping_without_the_setpoints_is_rejected(
    stream_mode: str, mappings: tuple[list[str], ...], missing: str
) -> None:
    with pytest.raises(DescriptorError, match=f"no PDO holds {missing}"):
        sent(OperationMode.CYCLIC_POSITION, *mappings, stream_mode=stream_mode)
