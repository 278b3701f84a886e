"""Process data that are too long for one frame."""

from __future__ import annotations

from pathlib import Path

from tests.plugins.ethercat.bus.robot import SMALL, started

MODULES, BYTES = 8, 100


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
    with started(str(path)) as robot:
        exchange = robot.master.exchange
        sent = exchange.counters.sent
        robot.until(lambda: exchange.counters.sent > sent + 250)
        counters = exchange.counters
        assert counters.lost + counters.incomplete < counters.sent / 20
