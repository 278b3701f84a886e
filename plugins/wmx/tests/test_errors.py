"""Error codes: one table, every code has a text, every failure says its thing."""

from __future__ import annotations

import pytest

from robotd.errors import ConnectError, DeviceTimeout, InvalidArgument, NotReady, OperationError
from robotd_cia402.code_tables import drive_remedy
from robotd_wmx._native import CallError
from robotd_wmx.al_status import TEXTS
from robotd_wmx.code_tables import AL_STATUS, DRIVE_ALARMS, WMX_ERRORS
from robotd_wmx.errors import (
    INVALID,
    LOCKED,
    NOT_READY,
    TIMEOUTS,
    names,
    table,
    text_of,
    translated,
)
from robotd_wmx.remedies import AL_REMEDIES, REMEDIES


def test_every_code_has_a_text() -> None:
    assert len(table()) == 389
    assert all(row.text for row in table().values())


def test_numbers_of_the_table_are_those_of_the_sdk() -> None:
    for (api, code), name in names().items():
        assert table()[api, name].code in (code, 0)  # 0: not known


def test_remedies_name_codes_that_exist_and_help_with_those_that_operators_meet() -> None:
    assert {name for _, name in table()} >= set(REMEDIES)
    assert set(TEXTS) >= set(AL_REMEDIES)
    assert "recover" in WMX_ERRORS.advice(1568)  # AxisAmpAlarm
    assert "Another program" in WMX_ERRORS.advice(297)  # CreateDeviceLockError
    assert "ENI" in AL_STATUS.advice(0x001D)
    assert WMX_ERRORS.advice(0) == AL_STATUS.advice(0) == ""  # no error, and codes not known


def test_the_alarm_of_a_drive_has_the_remedy_of_its_own_code() -> None:
    tables = [DRIVE_ALARMS, AL_STATUS, WMX_ERRORS]  # in the order of their entry points
    found = [advice for table in tables if (advice := table.advice(0x2310))]
    assert found[0] == drive_remedy(0x2310)
    assert "blocked axis" in found[0]


def test_groups_name_codes_that_exist() -> None:
    known = {name for _, name in table()}
    assert known >= NOT_READY | TIMEOUTS | INVALID | LOCKED


@pytest.mark.parametrize(
    ("api", "code", "text"),
    [
        ("engine", 297, "wmx 297 (device locked by another process)"),
        ("core motion", 65556, "wmx 65556 (the servo is off)"),
        ("advanced motion", 65556, "wmx 65556 (the servo is off)"),
        ("advanced motion", 1547, "wmx 1547 (no such axis)"),
        ("io", 81920, "wmx 81920 (the I/O image is not mapped)"),
        ("ecat", 8195, "wmx 8195 (no master: the EtherCAT platform is not loaded)"),
        ("io", 65556, "wmx 65556 (unknown io error 0x10014)"),
        ("engine", 4711, "wmx 4711 (unknown engine error 0x1267)"),
    ],
)
def test_texts(api: str, code: int, text: str) -> None:
    assert text_of(api, code) == text


def test_an_unknown_code_keeps_what_the_sdk_says() -> None:
    assert text_of("engine", 4711, "flux low") == (
        "wmx 4711 (unknown engine error 0x1267, the SDK says: flux low)"
    )


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("NotServoOn", NotReady),
        ("WaitTimeout", DeviceTimeout),
        ("AxisOutOfRange", InvalidArgument),
        ("ParameterSettingsInvalid", OperationError),
        ("", OperationError),
    ],
)
def test_errors_are_of_their_phase_and_keep_the_code(name: str, kind: type[Exception]) -> None:
    text = r"^axis 3: servo on: wmx 1 .* from Call$"
    with pytest.raises(kind, match=text) as raised, translated("servo on", axis=3):
        raise CallError("Call", "engine", 1, name, "")
    assert type(raised.value) is kind
    assert raised.value.code == 1  # type: ignore[attr-defined]
    assert raised.value.axis == 3  # type: ignore[attr-defined]


def test_opening_fails_with_a_connect_error_whatever_the_code() -> None:
    with pytest.raises(ConnectError), translated("device", ConnectError):
        raise CallError("CreateDevice", "engine", 269, "APIChannelError", "")
