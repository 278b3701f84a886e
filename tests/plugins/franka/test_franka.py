"""Options, alarms, findings and errors of the backend, without an arm."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from robotd.api import (
    ConnectError,
    DescriptorError,
    MachineContext,
    MonotonicClock,
    load_robot_descriptor,
)
from robotd_franka import machine_check
from robotd_franka.code_tables import (
    ALARMS,
    ERRORS,
    GUIDING,
    IDLE,
    MOVE,
    OTHER,
    RECOVERY,
    REFLEX,
    USER_STOPPED,
    alarm_of,
)
from robotd_franka.device import FrankaDevice
from robotd_franka.options import FrankaOptions

NOBODY = "127.255.255.1"  # an address of this computer on which nothing listens


def test_any_mode_but_three_is_an_alarm_with_a_remedy() -> None:
    for mode in (IDLE, MOVE, GUIDING):
        assert alarm_of(mode, ERRORS[:1]) == (0, "")
    for mode in (OTHER, REFLEX, USER_STOPPED, RECOVERY):
        code, text = alarm_of(mode)
        assert text.startswith(ALARMS.texts[code])
        assert ALARMS.advice(code) in text


def test_a_reflex_is_named_by_its_first_error_and_shows_the_others() -> None:
    code, text = alarm_of(REFLEX, ["joint_reflex", "power_limit_violation"])
    assert ALARMS.line(code) == f"alarm of a Franka arm {code}: reflex: joint_reflex"
    assert "power_limit_violation" in text
    assert "load_kg" in text


def test_an_error_of_a_later_libfranka_is_a_reflex() -> None:
    code, text = alarm_of(REFLEX, ["a_new_error"])
    assert code == REFLEX
    assert "recover" in text


@pytest.mark.parametrize(("key", "value"), [("stiffness", [600.0] * 6), ("damping", [10.0] * 8)])
def test_a_gain_for_each_joint_is_required(key: str, value: list[float]) -> None:
    options = FrankaOptions.model_validate({"address": NOBODY, key: tuple(value)})
    with pytest.raises(DescriptorError, match=rf"backends.franka.{key}: \d, must be 7"):
        options.check_robot(load_robot_descriptor("fr3"))


def test_an_arm_of_another_count_of_joints_is_rejected() -> None:
    with pytest.raises(DescriptorError, match="axes: 6, must be 7"):
        FrankaOptions(address=NOBODY).check_robot(load_robot_descriptor("cr3a"))


@pytest.mark.parametrize(
    ("address", "realtime", "needed"),
    [
        ("172.16.0.2", None, True),
        ("arm.example", None, True),
        ("127.0.0.1", None, False),
        ("localhost", None, False),
        ("172.16.0.2", False, False),
        ("127.0.0.1", True, True),
    ],
)
def test_a_realtime_kernel_is_required_by_arms_elsewhere(
    address: str, realtime: bool | None, needed: bool
) -> None:
    assert FrankaOptions(address=address, realtime=realtime).needs_realtime is needed


def test_nothing_is_connected_to_without_an_address() -> None:
    device = FrankaDevice(FrankaOptions(), MonotonicClock())
    with pytest.raises(ConnectError, match=r"--set backends\.franka\.address=ADDRESS"):
        device.open()


def test_an_arm_that_does_not_answer_is_named_with_what_to_look_at() -> None:
    device = FrankaDevice(FrankaOptions(address=NOBODY), MonotonicClock())
    with pytest.raises(ConnectError, match=rf"FCI at {NOBODY}.*active in Desk"):
        device.open()


def test_the_doctor_names_kernel_and_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "robot.yaml"
    section = {"franka": {"address": NOBODY, "realtime": True}}
    robot = {"schema": 1, "name": "arm", "extends": "fr3", "backend": "franka", "backends": section}
    file.write_text(yaml.safe_dump(robot), encoding="utf-8")
    monkeypatch.setattr(machine_check, "REALTIME", tmp_path / "realtime")
    context = MachineContext((load_robot_descriptor(file),), asks_devices=True)

    def texts() -> str:
        return " ".join(f"{found.verdict} {found.what}" for found in machine_check.checks(context))

    assert "not PREEMPT_RT" in texts()
    assert f"FCI at {NOBODY}:1337 does not answer" in texts()
    (tmp_path / "realtime").write_text("1\n", encoding="utf-8")
    assert "ok the kernel is PREEMPT_RT" in texts()
