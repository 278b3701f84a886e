"""The page of `robotd calibrate` in Chromium, on the simulated bus of an SO-101."""

from __future__ import annotations

import json
import math
import re
import signal
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml
from playwright.sync_api import Browser, Page, expect
from tests.features.page.server.browser import (
    CHROMIUM,
    chromium,
    has_sideways_scrolling,
    keep_screenshot,
    open_page,
)
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo
from tests.plugins.serial_servo.terminal import WAIT_S, Terminal

from robotd_serial_servo.calibration import read_calibration

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
ANGLES = {servo: 0.2 * servo - 0.7 for servo in range(1, 7)}
PHONE = {"width": 390, "height": 844}

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium (apt install chromium)"),
]


@pytest.fixture
def bus() -> Iterator[StsBus]:
    servos = {number: Servo(angle=angle) for number, angle in ANGLES.items()}
    for servo in servos.values():
        servo.set("return_delay", 0)
        servo.set("torque", 1)
    with StsBus(servos, seed=1) as bus:
        yield bus


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium(draws=False) as browser:
        yield browser


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    errors: list[str] = []
    page = open_page(browser, errors)
    yield page
    page.close()
    assert errors == []


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "my_arm.json"


@pytest.fixture
def terminal(bus: StsBus, tmp_path: Path, file: Path) -> Iterator[Terminal]:
    options = {"reply_timeout_s": 0.2}  # the servos share the processor with the browser
    robot = {"schema": 1, "name": "my_arm", "extends": "so101", "backends": {"feetech": options}}
    robot_file = tmp_path / "robot.yaml"
    robot_file.write_text(yaml.safe_dump(robot), encoding="utf-8")
    command = ("calibrate", "--robot", str(robot_file), "--port", bus.port)
    with closing(Terminal(*command, "--file", str(file), "--page")) as terminal:
        yield terminal


def address_of(terminal: Terminal) -> str:
    return terminal.expect_pattern(r"http://127\.0\.0\.1:\d+/[\w-]+/")


def torques(bus: StsBus) -> set[int]:
    return {servo.get("torque") for servo in bus.servos.values()}


def press(page: Page, button: str) -> None:
    page.get_by_role("button", name=button, exact=True).click()


def says(page: Page, text: str) -> None:
    expect(page.locator("#text")).to_contain_text(text)


def expect_ticks(page: Page, joint: str, column: str, ticks: int) -> None:
    """Wait until a cell of a joint shows ``ticks`` within two."""
    near = re.compile("|".join(str(ticks + off) for off in range(-2, 3)))
    row = page.locator("tr").filter(has_text=joint)
    expect(row.locator(f".{column}")).to_have_text(near)


def to_the_ranges(page: Page, terminal: Terminal) -> None:
    page.goto(address_of(terminal))
    press(page, "Servos off")
    press(page, "Middle")
    says(page, "from one end to the other")


def test_an_arm_is_calibrated_on_the_page(
    bus: StsBus, page: Page, terminal: Terminal, file: Path
) -> None:
    page.goto(address_of(terminal))
    says(page, "Support the arm")
    assert torques(bus) == {1}
    press(page, "Servos off")
    says(page, "middle of its range")
    assert torques(bus) == {0}
    bus.arm.move(ANGLES)
    expect_ticks(page, "shoulder_pan", "now", 2048 + round(ANGLES[1] * 4096 / math.tau))
    press(page, "Middle")
    says(page, "from one end to the other")
    press(page, "Done")
    expect(page.locator("#notice")).to_have_text(f"Not moved yet: {', '.join(JOINTS)}.")
    for turn, column, ticks in ((-0.8, "lowest", 2047 - 522), (1.1, "highest", 2047 + 717)):
        bus.arm.move({number: angle + turn for number, angle in ANGLES.items()})
        for joint in JOINTS:
            expect_ticks(page, joint, column, ticks)
    bus.arm.move(ANGLES)
    expect_ticks(page, "gripper", "now", 2047)
    expect(page.locator("#notice")).to_be_empty()
    expect(page.locator("tr").filter(has_text="gripper").locator(".degrees")).to_have_text("109°")
    keep_screenshot(page, "calibration")
    page.emulate_media(color_scheme="dark")
    page.set_viewport_size(PHONE)  # type: ignore[arg-type]
    assert not has_sideways_scrolling(page)
    keep_screenshot(page, "calibration-phone")
    press(page, "Done")
    says(page, "is written, and in the servos: start the robot anew with --set backends.feetech")
    terminal.expect("is written, and in the servos")
    assert terminal.process.wait(WAIT_S) == 0
    assert torques(bus) == {0}
    written = read_calibration(file)
    assert tuple(written) == JOINTS
    for servo, found in enumerate(written.values(), 1):
        assert (found.id, found.homing_offset) == (servo, bus[servo].get("offset"))
        assert (found.range_min, found.range_max) == pytest.approx((1525, 2764), abs=2)
        assert bus[servo].get("min_angle") == found.range_min
        assert bus[servo].get("max_angle") == found.range_max
    keep_screenshot(page, "calibration-end-phone")


def test_a_servo_that_comes_on_ends_it(
    bus: StsBus, page: Page, terminal: Terminal, file: Path
) -> None:
    to_the_ranges(page, terminal)
    bus[3].set("torque", 1)
    says(page, "servo 3, elbow_flex, is on without a command")
    says(page, "robotd calibrate --store")
    expect(page.get_by_role("button")).to_have_count(0)
    terminal.expect("servo 3, elbow_flex, is on without a command")
    assert terminal.process.wait(WAIT_S) == 1
    assert "wrist_roll, gripper have new offsets" in terminal.shown
    assert not file.exists()


def test_a_servo_without_supply_ends_it(bus: StsBus, page: Page, terminal: Terminal) -> None:
    page.goto(address_of(terminal))
    press(page, "Servos off")
    says(page, "middle of its range")
    bus[6].power_off()
    expect(page.locator("tr").filter(has_text="gripper").locator(".now")).to_have_text("no reply")
    says(page, "servo 6, gripper, has not answered for 2 s")
    assert terminal.process.wait(WAIT_S) == 1
    assert "new offsets" not in page.locator("#text").inner_text()


def test_abort_says_that_the_servos_have_new_offsets(
    page: Page, terminal: Terminal, file: Path
) -> None:
    to_the_ranges(page, terminal)
    press(page, "Abort")
    says(page, "aborted, no file is written")
    says(page, "wrist_roll, gripper have new offsets")
    assert terminal.process.wait(WAIT_S) == 1
    assert not file.exists()


def test_ctrl_c_aborts(page: Page, terminal: Terminal) -> None:
    page.goto(address_of(terminal))
    says(page, "Support the arm")
    terminal.process.send_signal(signal.SIGINT)
    says(page, "aborted, no file is written")
    terminal.expect("aborted, no file is written")
    assert terminal.process.wait(WAIT_S) == 1


def test_only_the_address_on_the_terminal_leads_to_the_page(
    bus: StsBus, terminal: Terminal
) -> None:
    address = urlsplit(address_of(terminal))
    own = f"{address.scheme}://{address.netloc}"

    def status(method: str, path: str, **headers: str) -> int:
        with closing(HTTPConnection(address.netloc, timeout=WAIT_S)) as connection:
            connection.request(method, path, headers=headers)
            return connection.getresponse().status

    wrong = f"/{'x' * 32}/"
    assert status("GET", "/") == status("GET", wrong) == status("GET", f"{wrong}state") == 403
    assert status("POST", f"{wrong}off") == status("POST", "/%ff/off") == 403
    assert status("GET", address.path, Host="elsewhere.example") == 403
    assert status("GET", address.path, Host=f"elsewhere.example:{address.port}") == 403
    assert status("POST", f"{address.path}off", Origin="http://elsewhere.example") == 403
    assert status("GET", f"{address.path}off") == 404  # a GET changes nothing
    assert status("POST", f"{address.path}done", Origin=own) == 409  # not yet
    assert torques(bus) == {1}
    with closing(HTTPConnection(address.netloc, timeout=WAIT_S)) as connection:
        connection.request("GET", f"{address.path}state")
        assert json.loads(connection.getresponse().read())["step"] == "support"
    assert status("POST", f"{address.path}off", Origin=own) == 204
