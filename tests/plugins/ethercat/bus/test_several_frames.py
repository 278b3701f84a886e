"""Process data that are too long for one frame."""

from __future__ import annotations

from pathlib import Path

from tests.plugins.ethercat.bus.robot import SMALL, started

MODULES, BYTES = 8, 100
IN_A_ROW = 50  # complete frames; a busy computer loses one now and then


def test_frames_that_come_back_one_after_the_other_are_complete(tmp_path: Path) -> None:
    """The second one comes later than SOEM waits for a frame that is there."""
    modules = [
        f"      - {{slave: {4 + number}, input_byte: {2 + number * BYTES}, input_length: {BYTES},"
        f" output_byte: {2 + number * BYTES}, output_length: {BYTES}}}\n"
        for number in range(MODULES)
    ]
    path = tmp_path / "large.yaml"
    text = Path(SMALL).read_text(encoding="utf-8").rstrip() + "\n"
    path.write_text(text + "".join(modules), encoding="utf-8")
    row = 0

    def count(_: object) -> None:
        nonlocal row
        row = 0 if exchange.bad_in_row else row + 1

    with started(str(path)) as robot:
        exchange = robot.master.exchange
        robot.robot.control_loop.every(250, "complete", count)
        robot.until(lambda: row > IN_A_ROW)
