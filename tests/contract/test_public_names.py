"""Names, options and limits that users rely on."""

from __future__ import annotations

import pytest

import robotd
from robotd.cli.run_command import RATE_HZ, run
from robotd.descriptor import CycleSettings

PUBLIC = {
    "ConnectError",
    "DescriptorError",
    "DeviceTimeout",
    "InvalidArgument",
    "NotReady",
    "OperationError",
    "PluginError",
    "Robot",
    "RobotdError",
    "Unsupported",
    "build_robot",
    "open_robot",
}


def test_options_offer_what_the_code_accepts() -> None:
    assert RATE_HZ in [option.type for option in run.params]
    limits = CycleSettings.model_json_schema()["properties"]["rate_hz"]
    assert (RATE_HZ.min, RATE_HZ.max) == (limits["minimum"], limits["maximum"])


def test_the_public_names_are_pinned() -> None:
    assert set(robotd.__all__) == PUBLIC
    assert sorted(robotd.__all__) == robotd.__all__
    for name in PUBLIC:
        assert getattr(robotd, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        robotd.nonsense  # noqa: B018
