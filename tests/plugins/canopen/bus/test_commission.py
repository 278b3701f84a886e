"""``robotd commission`` on a pseudo-terminal, against simulated drives in another process."""

from __future__ import annotations

import fcntl
import json
import os
import pty
import re
import select
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import yaml
from tests.plugins.canopen.bus.drives_process import (
    GROUP,
    PATIENCE,
    PORT,
    RATE_HZ,
    STALE_AFTER_S,
    DrivesProcess,
)

from robotd.clock import MonotonicClock, wait_until

WAIT_S = 60.0
REPEAT_S = 0.04  # of a key that is held
RIGHT = b"\x1b[C"
TRUE_SCALE, TRUE_POLARITY = 50000.0, -1
PLANTED = "{axis: 0, node: 1, counts_per_rad: 100000.0}"  # polarity and gear ratio are wrong
RIGHT_OF = "{axis: 0, node: 1, counts_per_rad: 50000.0, polarity: -1}"
ROBOT = """\
schema: 1
name: mine
backend: canopen
cycle: {{rate_hz: {rate}}}
engine: {{stale_after_s: {stale}, open_tries: 1}}
joints:
  # the shoulder of the machine
  - {{name: shoulder, axis: 0, lower_rad: -1.0, upper_rad: 1.0,
     velocity_rad_s: 1.0, acceleration_rad_s2: 4.0}}
  - {{name: elbow, axis: 1, lower_rad: -1.0, upper_rad: 1.0,
     velocity_rad_s: 1.0, acceleration_rad_s2: 4.0}}
backends:
  canopen:
    bus: {{interface: udp_multicast, channel: {group}, options: {{port: {port}}}}}
    sync_period_s: {period}
    heartbeat_timeout_s: {heartbeat}
    stream_timeout_s: {stream}
    sdo_timeout_s: 1.0
    axes:
      - {shoulder}    # left of the door
      - {{axis: 1, node: 2, counts_per_rad: 50000.0, polarity: -1}}
"""


def write(folder: Path, shoulder: str) -> Path:
    """Write a robot whose first drive is described as ``shoulder``."""
    path = folder / "robot.yaml"
    folder.mkdir(exist_ok=True)
    path.write_text(
        ROBOT.format(
            rate=RATE_HZ,
            stale=STALE_AFTER_S,
            group=GROUP,
            port=PORT,
            period=1 / RATE_HZ,
            heartbeat=PATIENCE["heartbeat_timeout_s"],
            stream=PATIENCE["stream_timeout_s"],
            shoulder=shoulder,
        )
    )
    return path


def _control_terminal() -> None:
    """Make the standard input the controlling terminal, whose Ctrl-C and loss are signals."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


class Terminal:
    """A command at work on a pseudo-terminal."""

    def __init__(self, *arguments: str) -> None:
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "robotd", *arguments],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=_control_terminal,  # noqa: PLW1509 - only a system call
        )
        os.close(slave)
        self.output = ""

    def expect(self, text: str, *, held: bytes = b"") -> str:
        """Wait for ``text``, with a key held meanwhile; return what came before it."""
        until_s = time.monotonic() + WAIT_S
        while text not in self.output:
            assert time.monotonic() < until_s, f"no {text!r} in {self.output!r}"
            assert self._read() or self.process.poll() is None, f"ended: {self.output!r}"
            if held:
                self.send(held)
        before, self.output = self.output.split(text, 1)
        return before

    def answer(self, question: str, reply: str) -> str:
        """Wait for a question and reply by a line."""
        before = self.expect(question)
        self.send(reply.encode() + b"\n")
        return before

    def send(self, data: bytes) -> None:
        os.write(self.master, data)

    def move_by_hand(
        self, question: str, push: Callable[[], None], condition: Callable[[float], bool]
    ) -> None:
        """Push when asked to, and press Enter once the shown position (°) meets ``condition``."""
        self.expect(question)
        push()
        self.hold_until(b"", condition)
        self.send(b"\n")

    def hold_until(self, key: bytes, condition: Callable[[float], bool]) -> None:
        """Hold a key until the shown position (°) meets ``condition``, then release it."""
        until_s = time.monotonic() + WAIT_S
        while True:
            assert time.monotonic() < until_s, f"not reached: {self.output[-200:]!r}"
            self.send(key)
            self._read()
            shown = re.findall(r"([-+][0-9.]+)°  ", self.output)
            if shown and condition(float(shown[-1])):
                return

    def wait(self) -> int:
        """Return the exit status."""
        until_s = time.monotonic() + WAIT_S
        while self.process.poll() is None and time.monotonic() < until_s:
            self._read()
        return self.process.wait(1.0)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        with suppress(OSError):
            os.close(self.master)

    def _read(self) -> bool:
        if not select.select([self.master], [], [], REPEAT_S)[0]:
            return False
        try:
            data = os.read(self.master, 4096)
        except OSError:  # the other end is closed
            return False
        self.output += data.decode(errors="replace")
        return bool(data)


@contextmanager
def commissioning(robot: Path, joint: str = "shoulder") -> Iterator[Terminal]:
    terminal = Terminal("commission", "--robot", str(robot), "--joint", joint)
    try:
        yield terminal
    finally:
        terminal.close()


@pytest.fixture
def drives(tmp_path: Path) -> Iterator[DrivesProcess]:
    """Power on the machine as it really is."""
    truth = write(tmp_path / "truth", RIGHT_OF)
    with DrivesProcess(str(truth)) as process:
        yield process


def push(drives: DrivesProcess, angle: float) -> Callable[[], None]:
    """Return a call that turns the first motor by hand."""
    return lambda: drives.inject(f"1 push {angle}")


def section(robot: Path) -> dict[str, Any]:
    axes = yaml.safe_load(robot.read_text())["backends"]["canopen"]["axes"]
    return dict(axes[0])


def recorded(robot: Path) -> dict[str, str]:
    """Return the finished steps of the shoulder."""
    record = json.loads(robot.with_name("robot.commission.json").read_text())
    return dict(record["joints"]["shoulder"])


def counts(drives: DrivesProcess) -> int:
    with drives.observed() as drive:
        return drive.position()


def test_wrong_polarity_and_gear_ratio_are_found_and_corrected(
    drives: DrivesProcess, tmp_path: Path
) -> None:
    robot = write(tmp_path / "mine", PLANTED)
    with commissioning(robot) as terminal:
        terminal.answer("Can shoulder be moved by hand (servo off", "y")
        terminal.move_by_hand(
            "POSITIVE direction", push(drives, 0.1), lambda degrees: degrees < -2.8
        )
        assert "polarity 1 becomes -1" in terminal.answer("Write this?", "y")
        terminal.answer("Can shoulder be moved by hand?", "y")
        terminal.move_by_hand("known amount", push(drives, 0.2), lambda degrees: degrees > 8.5)
        terminal.answer("How far did it move", "11.5")  # 0.2 rad, read from a scale
        assert "wrong by a factor of 1/2" in terminal.answer("Write this?", "y")
        terminal.expect("Home the axis now")
        terminal.send(b"\x03")  # left
        assert terminal.wait() == 130
    assert section(robot) == {"axis": 0, "node": 1, "counts_per_rad": TRUE_SCALE,
                              "polarity": TRUE_POLARITY}  # fmt: skip
    text = robot.read_text()
    assert "# the shoulder of the machine" in text
    assert "# left of the door" in text
    assert list(recorded(robot)) == ["identity", "direction", "scaling"]


def test_a_commissioning_that_was_left_is_resumed(drives: DrivesProcess, tmp_path: Path) -> None:
    robot = write(tmp_path / "mine", RIGHT_OF)
    done = dict.fromkeys(("identity", "direction", "scaling"), "right")
    record = robot.with_name("robot.commission.json")
    record.write_text(json.dumps({"joints": {"shoulder": done}}))
    with commissioning(robot) as terminal:
        shown = terminal.answer("Home the axis now", "y")
        assert "shoulder: scaling: right" in shown
        terminal.expect("its release stops")
        terminal.expect("release the key", held=RIGHT)
        terminal.expect("homed, position +0.00°")
        assert counts(drives) == pytest.approx(0, abs=500)
        terminal.answer("known to be right?", "n")
        terminal.answer("Move it by hand?", "y")
        terminal.move_by_hand("Move it there", push(drives, -0.5), lambda degrees: degrees < -28.0)
        terminal.answer("Move it by hand?", "y")
        terminal.move_by_hand("Move it there", push(drives, 0.7), lambda degrees: degrees > 11.0)
        terminal.answer("Write this?", "y")
        terminal.expect("+/- speed")
        terminal.hold_until(b"\x1b[D", lambda degrees: degrees < 5.0)
        terminal.send(b"\n")
        terminal.answer("Write this?", "y")
        terminal.move_by_hand("Support the load", lambda: None, lambda _: True)
        terminal.expect("it holds")
        terminal.expect("shoulder is commissioned")
        assert terminal.wait() == 0
    joint = yaml.safe_load(robot.read_text())["joints"][0]
    assert (joint["lower_rad"], joint["upper_rad"]) == pytest.approx((-0.5, 0.2), abs=0.01)
    assert section(robot)["startup"][0]["object"] == "0x6065"
    assert len(recorded(robot)) == 7


def test_a_jog_shows_a_wrong_direction_and_is_limited(
    drives: DrivesProcess, tmp_path: Path
) -> None:
    robot = write(tmp_path / "mine", "{axis: 0, node: 1, counts_per_rad: 50000.0}")
    with commissioning(robot) as terminal:
        terminal.answer("Can shoulder be moved by hand (servo off", "n")
        terminal.expect("Enter: done")
        assert counts(drives) == 0, "nothing moves without a key"
        terminal.hold_until(RIGHT, lambda degrees: degrees > 0.95)
        terminal.send(b"\n")
        terminal.answer("POSITIVE direction?", "n")
        terminal.answer("Write this?", "n")
        assert terminal.wait() == 1
    assert section(robot) == {"axis": 0, "node": 1, "counts_per_rad": 50000.0}
    # A busy computer ends the jog late.
    assert counts(drives) == pytest.approx(50000 * 0.01745, rel=0.3)


def test_the_loss_of_the_terminal_stops_the_axis(drives: DrivesProcess, tmp_path: Path) -> None:
    robot = write(tmp_path / "mine", RIGHT_OF)
    with commissioning(robot) as terminal:
        terminal.answer("Can shoulder be moved by hand (servo off", "n")
        terminal.expect("Enter: done")
        terminal.hold_until(RIGHT, lambda degrees: degrees > 0.2)
        os.close(terminal.master)
        assert terminal.process.wait(WAIT_S) == 130
    assert abs(counts(drives)) < 50000 * 0.0174
    drives.inject("1 push 0.1")  # possible with the servo off only
    is_pushed = lambda: abs(counts(drives)) > 50000 * 0.08  # noqa: E731
    assert wait_until(is_pushed, WAIT_S, MonotonicClock())


def test_a_jammed_axis_is_found(drives: DrivesProcess, tmp_path: Path) -> None:
    robot = write(tmp_path / "mine", RIGHT_OF)
    drives.inject("1 block")
    with commissioning(robot) as terminal:
        terminal.answer("Can shoulder be moved by hand (servo off", "n")
        terminal.expect("Enter: done")
        terminal.expect("it is jammed, its brake is closed", held=RIGHT)
        assert terminal.wait() == 5
    assert section(robot)["counts_per_rad"] == TRUE_SCALE


def test_another_drive_is_rejected(drives: DrivesProcess, tmp_path: Path) -> None:
    identity = "identity: {vendor_id: 7, product_code: 8}"
    robot = write(tmp_path / "mine", RIGHT_OF.replace("}", f", {identity}}}"))
    with commissioning(robot) as terminal:
        terminal.expect("(vendor_id) is 0x")
        assert terminal.wait() == 5
