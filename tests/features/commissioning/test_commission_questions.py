"""Ctrl-C at the questions of ``robotd commission``, on a pseudo-terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import subprocess
import sys
import termios
import time

QUESTIONS = 200
WAIT_S = 60.0
PROGRAM = """
import signal, threading, time
from typing import Any
import click
from robotd_commissioning.commission_terminal import CommissionTerminal

def work() -> None:  # holds the interpreter, as the threads of a robot do
    while True:
        until_s = time.perf_counter() + 1e-3
        while time.perf_counter() < until_s:
            pass
        time.sleep(1e-3)

signal.signal(signal.SIGINT, signal.default_int_handler)
axis: Any = None
terminal = CommissionTerminal(axis)
for _ in range(2):
    threading.Thread(target=work, daemon=True).start()
number = 0
while True:
    try:
        click.echo(f"answer {terminal.agrees('question')}.")
    except (click.Abort, KeyboardInterrupt):
        number += 1
        click.echo(f"left {number}.")
"""


def _control_terminal() -> None:
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def _expect(master: int, text: str) -> None:
    """Wait for ``text`` at the end of what is shown."""
    until_s, shown = time.monotonic() + WAIT_S, ""
    while not shown.endswith(text):
        left_s = until_s - time.monotonic()
        assert select.select([master], [], [], max(0.0, left_s))[0], f"no {text!r} in {shown!r}"
        shown += os.read(master, 1).decode("latin-1")


def test_ctrl_c_at_the_instant_of_a_question_is_never_missed() -> None:
    master, slave = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        start_new_session=True,
        env={**os.environ, "PYTHONIOENCODING": "utf-8:strict"},
        preexec_fn=_control_terminal,  # noqa: PLW1509 - only a system call
    ) as process:
        os.close(slave)
        try:
            for number in range(1, QUESTIONS + 1):
                _expect(master, "question")
                os.write(master, b"\x03")
                _expect(master, f"left {number}.")
            _expect(master, "question [y/N]: ")
            os.write(master, b"maybe\n")
            _expect(master, "'maybe' is not y or n")
            _expect(master, "question [y/N]: ")
            os.write(master, b"\xe9\n")  # of a terminal that is not UTF-8
            _expect(master, "is not y or n")
            _expect(master, "question [y/N]: ")
            os.write(master, b"yes\n")
            _expect(master, "answer True.")
        finally:
            process.kill()
            os.close(master)
