"""A command of robotd at a terminal of its own."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time

WAIT_S = 30.0


class Terminal:
    """A command of robotd, what it shows, and what is typed."""

    def __init__(self, *words: str) -> None:
        self._master, slave = pty.openpty()
        program = "import sys; from robotd.cli.main import main; sys.exit(main())"
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, *words],
            stdin=slave, stdout=slave, stderr=slave, start_new_session=True,
        )  # fmt: skip
        os.close(slave)
        self.shown = ""

    def expect(self, text: str) -> None:
        """Wait until it has shown ``text``."""
        self.expect_pattern(re.escape(text))

    def expect_pattern(self, pattern: str) -> str:
        """Wait until it has shown ``pattern``, and return that part."""
        deadline = time.monotonic() + WAIT_S
        while not (found := re.search(pattern, self.shown)):
            left_s = deadline - time.monotonic()
            assert left_s > 0, self.shown
            if select.select([self._master], [], [], left_s)[0]:
                self.shown += os.read(self._master, 4096).decode(errors="replace")
        return found[0]

    def expect_row(self, joint: str, ticks: int) -> None:
        """Wait for a row of the table that shows a position within two ticks."""
        near = "|".join(str(ticks + off) for off in range(-2, 3))
        self.expect_pattern(rf"{joint}\s.*\b({near})\b")

    def answer(self, line: str) -> None:
        """Type a line; what was shown before is left behind."""
        self.shown = ""
        os.write(self._master, f"{line}\n".encode())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._master)
