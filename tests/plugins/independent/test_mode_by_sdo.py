"""A drive that has neither 0x6060 nor 0x6061 in a PDO: its mode is changed by SDO, at rest."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from structlog.testing import capture_logs
from tests.plugins.independent.conftest import COUNTS_PER_RAD, START_RAD, Bench, OpenBench

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.axes import Jog, Move
from robotd.device.state import CommandMode
from robotd.errors import RobotdError
from robotd.motion.profile import Profile

MODES = (0x6060, 0x6061)
PP, HOMING, CSP = 1, 6, 8
TIMEOUT_S = 1.0  # for an answer: a busy computer may take longer than the default
PROFILE = Profile(1.0, 5.0, 5.0)
BY_SDO: dict[str, Any] = {"unmapped": MODES, "mode_delay_s": 0.02}


@contextmanager
def started(
    open_bench: OpenBench, axis: dict[str, Any] | None = None, **knobs: Any
) -> Iterator[Bench]:
    described = {"tpdos": [], **(axis or {})}
    with open_bench(described, {"sdo_timeout_s": TIMEOUT_S}, **{**BY_SDO, **knobs}) as bench:
        bench.robot.start()
        yield bench


def end_of_motion(bench: Bench) -> None:
    bench.robot.axes.wait_for_motion()
    bench.until(lambda: not bench.image.operation[0])


def failure(command: Callable[[], object]) -> tuple[threading.Thread, list[RobotdError]]:
    """Begin ``command`` in a thread; return it with the error that it will have raised."""
    found: list[RobotdError] = []

    def run() -> None:
        try:
            command()
        except RobotdError as error:
            found.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, found


def test_it_follows_moves_jogs_and_homes_without_a_jump(open_bench: OpenBench) -> None:
    with capture_logs() as lines, started(open_bench) as bench:
        axes, image = bench.robot.axes, bench.image
        assert bench.drive["mode"] == CSP
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        axes.move([Move(0, 1.2, PROFILE)])
        assert bench.drive["mode"] == PP
        end_of_motion(bench)
        assert image.motion_complete[0]
        assert bench.drive["position"] == pytest.approx(1.2 * COUNTS_PER_RAD, abs=20)
        assert bench.move(1.0).outcome is Outcome.SUCCEEDED
        axes.set_command_mode(0, CommandMode.VELOCITY)
        axes.jog([Jog(0, Profile(-0.5, 2.0, 2.0))])
        bench.drive.wait(lambda measured: measured["velocity"] == pytest.approx(-5000, rel=0.01))
        axes.stop([0])
        end_of_motion(bench)
        axes.set_command_mode(0, CommandMode.POSITION)
        axes.home(0)
        assert bench.drive["mode"] == CSP
        assert image.position[0] == pytest.approx(0.0, abs=1e-3)
        assert bench.move(0.4).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()
        writes = bench.drive["writes"]
        assert "6040:0" not in writes
        assert writes["6060:0"] == len([CSP, PP, CSP, 3, CSP, HOMING, CSP])
    [line] = [line for line in lines if line["event"] == "objects not in the default PDOs"]
    assert [effect[:6] for effect in line["effects"]][:2] == ["0x6060", "0x6061"]


@pytest.mark.parametrize("unmapped", MODES)
def test_one_of_the_two_in_a_pdo(open_bench: OpenBench, unmapped: int) -> None:
    with started(open_bench, unmapped=(unmapped,)) as bench:
        bench.robot.axes.move([Move(0, 1.2, PROFILE)])
        end_of_motion(bench)
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_a_search_for_the_index_tells_its_result_in_the_mode_of_before(
    open_bench: OpenBench,
) -> None:
    speeds = {"homing_speed_rad_s": 1.0, "homing_creep_rad_s": 0.5}
    axis = {"homing_method": 34, "homing_acceleration_rad_s2": 5.0, **speeds}
    with started(open_bench, axis, encoder=4096, feed=4096) as bench:
        bench.robot.axes.home(0)
        assert bench.drive["mode"] == CSP
        measured = bench.drive.ask()
        assert abs(measured["velocity"]) < 1
        at = (measured["position"] - 16_384) / COUNTS_PER_RAD  # the index
        assert bench.image.position[0] == pytest.approx(at, abs=1e-3)
        assert bench.image.position_command[0] == pytest.approx(at, abs=2e-3)
        assert not bench.has_jumped()


def test_a_stop_in_a_move_and_the_next_motion(open_bench: OpenBench) -> None:
    with started(open_bench, mode_delay_s=0.0) as bench:
        axes = bench.robot.axes
        axes.move([Move(0, -1.5, PROFILE)])
        bench.until(lambda: bench.image.position[0] < 1.0)
        axes.stop([0])
        end_of_motion(bench)
        stopped = bench.drive["position"]
        assert stopped > 0
        assert bench.move(stopped / COUNTS_PER_RAD + 0.1).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped(), "towards the target of the move, which is still in 0x607A"


def test_a_stop_while_the_mode_changes_begins_no_motion(open_bench: OpenBench) -> None:
    with started(open_bench, mode_delay_s=0.5) as bench:
        axes = bench.robot.axes
        move, failed = failure(lambda: axes.move([Move(0, 0.5, PROFILE)]))
        bench.drive.wait(lambda measured: measured["writes"].get("6060:0") == 2)
        axes.stop([0])
        move.join(60.0)
        assert "stopped before the motion began" in str(failed[0])
        assert bench.drive["position"] == pytest.approx(START_RAD * COUNTS_PER_RAD, abs=20)
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_nothing_is_commanded_in_a_mode_that_is_not_confirmed(open_bench: OpenBench) -> None:
    """The drive takes the mode of moves 1.5 s late, after the move was given up."""
    with started(open_bench) as bench:
        axes = bench.robot.axes
        bench.drive.set(mode_delay_s=1.5)
        with pytest.raises(
            RobotdError, match=r"mode 1 \(profile position\) was written, the drive"
        ):
            axes.move([Move(0, 0.5, PROFILE)])
        bench.drive.wait(lambda measured: measured["mode"] == PP)
        assert bench.drive["position"] == pytest.approx(START_RAD * COUNTS_PER_RAD, abs=20)
        bench.drive.set(mode_delay_s=0.0)
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


@pytest.mark.parametrize(
    ("silent", "text"), [(0x6060, "writing 0x6060"), (0x6061, "reading 0x6061")]
)
def test_no_answer_while_the_mode_changes(open_bench: OpenBench, silent: int, text: str) -> None:
    """It may have changed: what it was in before is not taken for its mode."""
    with started(open_bench) as bench:
        axes = bench.robot.axes
        bench.drive.set(sdo_mute=(silent,))
        syncs = bench.drive["counts"]["syncs"]
        move, failed = failure(lambda: axes.move([Move(0, 0.5, PROFILE)]))
        bench.drive.wait(lambda measured: measured["counts"]["syncs"] > syncs + 30)
        assert move.is_alive(), "the control loop goes on while the command waits"
        move.join(60.0)
        assert re.search(rf"{text}:00 .*no answer within 1 s", str(failed[0]))
        bench.drive.set(sdo_mute=())
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        axes.move([Move(0, 0.5, PROFILE)])
        end_of_motion(bench)
        assert bench.drive["position"] == pytest.approx(0.5 * COUNTS_PER_RAD, abs=20)
        assert not bench.has_jumped()


def test_a_drive_that_refuses_the_mode(open_bench: OpenBench) -> None:
    with started(open_bench) as bench:
        axes = bench.robot.axes
        bench.drive.set(rejected=(0x6060,), rejection="abort")
        with pytest.raises(RobotdError, match=r"writing 0x6060:00 .*abort 0x08000022"):
            axes.move([Move(0, 0.5, PROFILE)])
        bench.drive.set(rejected=())
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert not bench.has_jumped()


def test_a_refused_mode_does_not_switch_the_servo_on(open_bench: OpenBench) -> None:
    with open_bench(axis={"tpdos": []}, rejected=(0x6060,), rejection="abort", **BY_SDO) as bench:
        with pytest.raises(RobotdError, match=r"writing 0x6060:00 .*abort 0x08000022"):
            bench.robot.start()
        assert "enabled" not in bench.drive["counts"]


def test_answers_that_take_half_a_second(open_bench: OpenBench) -> None:
    with started(open_bench) as bench:
        axes = bench.robot.axes
        bench.drive.set(sdo_delay_s=0.5)
        axes.move([Move(0, 0.5, PROFILE)])
        end_of_motion(bench)
        assert bench.drive["position"] == pytest.approx(0.5 * COUNTS_PER_RAD, abs=20)
        assert not bench.has_jumped()


def test_a_mode_that_another_master_has_changed_is_set_before_a_motion(
    open_bench: OpenBench,
) -> None:
    with started(open_bench) as bench:
        fieldbus = bench.robot.fieldbus
        fieldbus.write_object(0, 5, 0x6060, 0, bytes([PP]))
        bench.drive.wait(lambda measured: measured["mode"] == PP)
        assert bench.move(2.0).outcome is Outcome.SUCCEEDED
        assert bench.drive["mode"] == CSP
        assert not bench.has_jumped()
