"""A drive with node guarding only: it has no object 0x1017, and is supervised by its PDOs."""

from __future__ import annotations

import pytest
from tests.plugins.independent.conftest import OpenBench

from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import DescriptorError

WITHOUT = {"absent": (0x1016, 0x1017)}
AXIS = {"heartbeat": False}


def test_it_moves_and_its_silence_is_the_loss_of_its_pdos(open_bench: OpenBench) -> None:
    section = {"heartbeat_timeout_s": 0.5}
    with open_bench(AXIS, section, **WITHOUT) as bench:
        bench.robot.start()
        assert bench.move(2.0, seconds=1.5).outcome is Outcome.SUCCEEDED
        assert "1017:0" not in bench.drive["writes"]
        bench.drive.set(mute=True)
        bench.until(lambda: bool(bench.image.offline[0]))
        assert "TPDO 1 has not come for" in bench.image.reason[0]
        bench.drive.set(mute=False)
        bench.until(lambda: bench.robot.connection.ready)


def test_a_reset_is_noticed_by_its_boot_up_message(open_bench: OpenBench) -> None:
    with open_bench(AXIS, **WITHOUT) as bench:
        bench.robot.start()
        bench.drive.do("restart")
        bench.until(lambda: "it was reset" in bench.image.reason[0])
        bench.robot.recover()
        assert bench.move(1.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_the_file_of_such_a_drive_names_the_key(open_bench: OpenBench) -> None:
    with (
        pytest.raises(DescriptorError, match=r"0x1017 .* is not in the EDS: set heartbeat: false"),
        open_bench(**WITHOUT),
    ):
        pass
