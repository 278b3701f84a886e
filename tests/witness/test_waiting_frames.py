"""A cut cable and an adapter that keeps its frames: what the drives execute when it is healed."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from tests.witness.bench import COUNTS_PER_RAD
from tests.witness.canopen_bench import LATE_SETPOINTS, CanopenBench
from tests.witness.silences import PATIENT, silence_in_a_path

from robotd.motion import TrajectoryRequest
from robotd_canopen.canopen_drive import CanopenDrive
from robotd_canopen.sync_gate import CLOSING_SYNCS, MAX_PROBES, SyncGate

RPDOS = range(0x200, 0x580)
SYNC = 0x80
STALE_S = 3.0  # the cuts here are shorter, so that paths go on after them
FRAMES_PER_SYNC = 6  # SYNC, heartbeat, and two RPDOs of each axis
DRIVEN_RAD_S = 8.0  # of a wheel at 0.8 m/s
LATE_PERIODS = 3  # from a command to its SYNC

Speeds = tuple[float, float]


def cut_in_a_path(bench: CanopenBench, seconds: float, speed: float) -> str:
    """Cut the cable in the midst of a path; return the outcome of the path."""
    bench.silence = lambda s, *_: bench.cut_cable(s)  # type: ignore[method-assign]
    return silence_in_a_path(bench, speed, seconds, [])[0]


def count_late(bench: CanopenBench, *identifiers: int) -> int:
    return sum(message.arbitration_id in identifiers for message in bench.line.waited)


@pytest.mark.parametrize(
    ("seconds", "speed"), [(0.006, 3.0), (0.025, 1.0), (0.065, 3.0), (0.4, 1.0), (1.5, 3.0)]
)
def test_the_drives_get_no_step_and_no_burst(seconds: float, speed: float) -> None:
    engine = {"stale_after_s": STALE_S}
    bench = CanopenBench(engine=engine, section={"heartbeat_timeout_s": STALE_S}, keeps=True)
    outcome = cut_in_a_path(bench, seconds, speed)
    assert bench.findings == []
    assert outcome in {"Outcome.SUCCEEDED", "Outcome.FAULT"}  # the joint was left too far behind
    assert count_late(bench, SYNC) <= CLOSING_SYNCS + MAX_PROBES
    assert count_late(bench, *RPDOS) <= LATE_SETPOINTS * 2 * len(bench.drives)
    assert len(bench.line.waited) > 0


def test_a_robot_whose_cable_was_cut_for_long_recovers() -> None:
    bench = CanopenBench(keeps=True)
    with bench.requested():
        bench.robot.start()
        names, cut_s = bench.robot.joint_names, 5.0
        path = TrajectoryRequest.from_rows(names, [2.0], [[1.0, -1.0]])
        with bench.robot.follower.follow(path):
            bench.run(1.0)
            bench.cut_cable(cut_s)
            bench.run(cut_s + 0.5)
        waited = len(bench.line.waited)
        bench.robot.recover()
        back = TrajectoryRequest.from_rows(names, [2.0], [[-0.2, 0.2]])
        with bench.robot.follower.follow(back) as execution:
            bench.run(2.5)
        bench.robot.shutdown()
    assert execution.done
    assert bench.findings == []
    assert 0 < waited <= (LATE_SETPOINTS + MAX_PROBES) * FRAMES_PER_SYNC


def open_for_ever(gate: SyncGate, unanswered: int, received: int) -> None:
    gate.is_closed, gate.sends = False, True


def test_without_the_gate_frames_of_the_past_are_executed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SyncGate, "advance", open_for_ever)
    bench = CanopenBench(engine=PATIENT, keeps=True)
    cut_in_a_path(bench, 0.4, 0.1)
    assert count_late(bench, SYNC) > CLOSING_SYNCS + MAX_PROBES


def come_to_rest(fault: Callable[[CanopenBench], None]) -> tuple[CanopenBench, list[Speeds]]:
    """Let a base drive, and come to rest while no drive answers.

    Returns the bench, and the velocities of the left wheel in each period: that which robotd
    commands, and that which its drive has got.
    """
    engine, section = {"stale_after_s": STALE_S}, {"heartbeat_timeout_s": STALE_S}
    bench = CanopenBench(axes=1, base=True, keeps=True, engine=engine, section=section)
    with bench.requested():
        bench.robot.start()
    base, drive, found = bench.robot.base, bench.drives[1], []
    assert base is not None
    base.command(0.8, 0.0, timeout_s=10.0)
    bench.run(1.0)
    assert drive[0x60FF] == pytest.approx(DRIVEN_RAD_S * COUNTS_PER_RAD)
    fault(bench)
    bench.run(0.1)
    base.command(0.0, 0.0)
    for _ in range(round(1.0 / bench.judges[1].period_s)):
        commanded, _ = base.wheels.speeds(base.limited)
        found.append((commanded, drive[0x60FF] / COUNTS_PER_RAD))
        bench.run(bench.judges[1].period_s)
    bench.run(1.5)
    bench.robot.shutdown()
    return bench, found


@pytest.mark.parametrize(("factor", "right"), [(2, True), (1 << 31, False)], ids=["now", "probe"])
def test_a_velocity_drive_whose_answers_are_lost_becomes_slower_at_once(
    monkeypatch: pytest.MonkeyPatch, factor: int, right: bool
) -> None:
    """Not with the next probe: it is never more than twice as fast as it is commanded."""
    monkeypatch.setattr("robotd_canopen.canopen_drive._SLOWER", factor)
    bench, found = come_to_rest(lambda bench: bench.silence(2.0, how="answers"))
    assert bench.findings == []
    got = [velocity for _, velocity in found[LATE_PERIODS:]]
    pairs = zip(found, got, strict=False)
    assert all(got <= 2 * commanded + 1e-6 for (commanded, _), got in pairs) is right
    assert got[-1] == 0.0


def test_lower_velocities_that_wait_in_an_adapter_are_few() -> None:
    bench, found = come_to_rest(lambda bench: bench.cut_cable(2.0))
    assert bench.findings == []
    assert found[-1] == (0.0, DRIVEN_RAD_S)  # it hears nothing
    halvings = math.log2(DRIVEN_RAD_S * COUNTS_PER_RAD) + 1
    assert 0 < count_late(bench, SYNC) <= CLOSING_SYNCS + MAX_PROBES + halvings
    assert bench.drives[1][0x60FF] == 0


SETTLING: list[tuple[Callable[[pytest.MonkeyPatch], None], bool]] = [
    (lambda _: None, True),
    (lambda patch: patch.setattr(CanopenDrive, "settling", 0), False),
]


@pytest.mark.parametrize(("change", "right"), SETTLING, ids=["settling", "at once"])
def test_a_short_queue_may_deliver_setpoints_with_the_end_of_a_silence(
    monkeypatch: pytest.MonkeyPatch, change: Callable[[pytest.MonkeyPatch], None], right: bool
) -> None:
    """As SocketCAN has one. The first answer is from before those setpoints."""
    monkeypatch.setattr(SyncGate, "advance", open_for_ever)
    change(monkeypatch)
    bench = CanopenBench(engine=PATIENT, keeps=True)
    bench.line.queue_frames = 3 * FRAMES_PER_SYNC
    cut_in_a_path(bench, 0.1, 3.0)
    assert (bench.findings == []) is right, bench.findings
