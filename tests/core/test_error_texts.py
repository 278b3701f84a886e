"""The text of an error: its axis once, by name where the core knows it."""

from __future__ import annotations

import pytest

from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    NotReady,
    OperationError,
    RobotdError,
    Unsupported,
)


@pytest.mark.parametrize("kind", [OperationError, NotReady, DeviceTimeout])
def test_the_axis_is_part_of_the_text_but_not_of_the_reason(kind: type[RobotdError]) -> None:
    error = kind("servo is off", axis=1, code=0x29)
    assert (error.reason, error.axis, error.code) == ("servo is off", 1, 0x29)
    assert str(error) == "axis 1: servo is off"
    error.axis_name = "joint2"
    assert str(error) == "joint2: servo is off"


def test_an_error_without_an_axis_is_its_reason() -> None:
    error = OperationError("no bus")
    assert (str(error), error.axis, error.code) == ("no bus", None, None)


def test_unsupported_names_the_backend_once_it_is_known() -> None:
    assert str(Unsupported("homing")) == "homing: not supported by this backend"
    assert str(Unsupported("homing", "acme")) == "homing: not supported by the acme backend"


def test_children_that_fail_for_one_reason_share_a_line() -> None:
    failures = {
        "arm → joint1": "no answer",
        "arm → joint2": "alarm 16",
        "arm → joint3": "no answer",
    }
    assert str(ConnectError("joints could not be enabled", failures)).splitlines() == [
        "joints could not be enabled",
        "  arm → joint1, arm → joint3: no answer",
        "  arm → joint2: alarm 16",
    ]


def test_a_long_key_is_cut() -> None:
    assert str(DescriptorError("is wrong", key="k" * 5000)) == f"{'k' * 200}…: is wrong"
