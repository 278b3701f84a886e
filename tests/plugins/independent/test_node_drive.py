"""The independent drive against CiA 402-2, in simulated time: states and modes."""

from __future__ import annotations

import struct

import pytest
from tests.plugins.independent.canopen_objects import INVALID
from tests.plugins.independent.cia402_node import State
from tests.plugins.independent.node_bench import NODE, TURN, Bench, booted, moving

pytestmark = pytest.mark.daily


@pytest.fixture
def bench() -> Bench:
    return booted()


# CiA 402: states


WALKS = [  # controlwords, then state and statusword & 0x6F
    ((), State.SWITCH_ON_DISABLED),
    ((0x07,), State.SWITCH_ON_DISABLED),
    ((0x0F,), State.SWITCH_ON_DISABLED),
    ((0x06,), State.READY),
    ((0x06, 0x07), State.SWITCHED_ON),
    ((0x06, 0x0F), State.ENABLED),
    ((0x06, 0x07, 0x0F), State.ENABLED),
    ((0x06, 0x00), State.SWITCH_ON_DISABLED),
    ((0x06, 0x02), State.SWITCH_ON_DISABLED),
    ((0x06, 0x07, 0x06), State.READY),
    ((0x06, 0x07, 0x00), State.SWITCH_ON_DISABLED),
    ((0x06, 0x07, 0x02), State.SWITCH_ON_DISABLED),
    ((0x06, 0x0F, 0x07), State.SWITCHED_ON),
    ((0x06, 0x0F, 0x06), State.READY),
    ((0x06, 0x0F, 0x00), State.SWITCH_ON_DISABLED),
    ((0x06, 0x0F, 0x02), State.SWITCH_ON_DISABLED),
    ((0x06, 0x86), State.READY),
]


@pytest.mark.parametrize(("words", "state"), WALKS)
def test_transitions(bench: Bench, words: tuple[int, ...], state: State) -> None:
    bench.control(*words)
    bench.wait(0.01)
    assert bench.drive.power is state
    mask = 0x4F if state in {State.SWITCH_ON_DISABLED, State.FAULT} else 0x6F
    assert bench.read(0x6041) & mask == state & mask


@pytest.mark.parametrize(
    ("option", "seconds", "after"),
    [
        (1, 0.1, State.SWITCH_ON_DISABLED),
        (2, 0.025, State.SWITCH_ON_DISABLED),
        (5, 0.1, State.QUICK_STOP),
        (6, 0.025, State.QUICK_STOP),
    ],
)
def test_quick_stop_options(bench: Bench, option: int, seconds: float, after: State) -> None:
    bench.write(0x605A, 0, option, 2)
    moving(bench)
    bench.control(0x02)
    bench.wait(seconds - 0.01)
    assert bench.drive.power is State.QUICK_STOP
    assert bench.drive.axis.velocity > 0
    bench.wait(0.02)
    assert bench.drive.power is after
    assert bench.drive.axis.velocity == 0
    bench.control(0x0F)
    assert (bench.drive.power is State.ENABLED) == (option >= 5)


def test_disable_voltage_coasts_at_once(bench: Bench) -> None:
    moving(bench)
    bench.control(0x00)
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert bench.drive.axis.velocity > 0


def test_disable_operation_ramps_first(bench: Bench) -> None:
    moving(bench)
    bench.control(0x07)
    bench.wait(0.05)
    assert bench.drive.power is State.ENABLED
    bench.wait(0.1)
    assert bench.drive.power is State.SWITCHED_ON


def test_halt_stops_and_stays_enabled(bench: Bench) -> None:
    moving(bench)
    bench.control(0x10F)
    bench.wait(0.2)
    assert bench.drive.power is State.ENABLED
    assert bench.drive.axis.velocity == 0
    assert bench.read(0x6041) & 0x400
    bench.control(0x0F)
    bench.wait(0.1)
    assert bench.drive.axis.velocity > 0


def test_fault_ramps_and_needs_a_rising_edge_to_be_reset(bench: Bench) -> None:
    moving(bench)
    bench.write(0x6040, 0, 0x8F, 2)
    bench.drive.fault(0x3210)
    assert bench.drive.power is State.FAULT_REACTION
    bench.wait(0.1)
    assert bench.drive.power is State.FAULT
    assert bench.read(0x603F) == 0x3210
    bench.control(0x8F)
    assert bench.drive.power is State.FAULT
    bench.control(0x0F, 0x8F)
    assert bench.drive.power is State.SWITCH_ON_DISABLED
    assert bench.read(0x603F) == 0
    codes = [struct.unpack_from("<H", data)[0] for data in bench.sent(0x80 + NODE)]
    assert codes == [0x3210, 0]


def test_fault_code_may_be_in_the_emergency_only(bench: Bench) -> None:
    bench.drive.knobs.code_in_603f = False
    bench.drive.fault(0x3210)
    assert bench.read(0x603F) == 0
    assert struct.unpack_from("<H", bench.sent(0x80 + NODE)[0])[0] == 0x3210


@pytest.mark.parametrize(
    ("option", "state"),
    [
        (0, State.ENABLED),
        (1, State.FAULT),
        (2, State.SWITCH_ON_DISABLED),
        (3, State.SWITCH_ON_DISABLED),
    ],
)
def test_abort_connection_when_the_node_is_stopped(bench: Bench, option: int, state: State) -> None:
    bench.write(0x6007, 0, option, 2)
    bench.nmt(1)
    moving(bench)
    bench.nmt(2)
    bench.wait(0.2)
    assert bench.drive.power is state


def test_statusword_may_be_late(bench: Bench) -> None:
    bench.drive.knobs.status_delay_s = 0.2
    bench.wait(0.3)
    bench.control(0x06)
    assert bench.read(0x6041) & 0x4F == State.SWITCH_ON_DISABLED
    bench.wait(0.25)
    assert bench.read(0x6041) & 0x6F == State.READY


# CiA 402: modes


def test_csp_follows_interpolated_targets(bench: Bench) -> None:
    bench.write(0x607A, 0, 123_456)
    bench.enable(8)
    for step in range(1, 101):
        bench.write(0x607A, 0, 123_456 + 100 * step)
        bench.wait(0.002)
    assert bench.drive.axis.max_step == 100
    assert bench.drive.axis.velocity == pytest.approx(50_000, rel=0.02)
    bench.wait(0.1)
    assert bench.read(0x6064) == 123_456 + 10_000


def test_csp_jumps_to_a_distant_target_at_its_highest_speed(bench: Bench) -> None:
    bench.enable(8)  # 0x607A still has its value of power-on, 0
    bench.wait(1.0)
    assert abs(bench.drive.axis.position) < 1
    assert bench.drive.axis.max_step == 123_456
    assert bench.drive.axis.max_velocity == bench.drive.knobs.max_speed


def test_following_error_is_a_fault(bench: Bench) -> None:
    bench.write(0x6065, 0, 1000)
    bench.write(0x6066, 0, 10, 2)
    bench.enable(8)
    bench.wait(0.3)
    assert bench.drive.power is State.FAULT
    assert bench.read(0x603F) == 0x8611


def test_csv_and_pv_reach_their_speed(bench: Bench) -> None:
    for mode in (9, 3):
        moving(bench, 50_000)
        bench.write(0x6060, 0, mode, 1)
        bench.wait(0.2)
        assert bench.drive[0x606C] == pytest.approx(50_000, rel=0.01)
    assert bench.read(0x6041) & 0x1400 == 0x400
    bench.write(0x60FF, 0, 0)
    bench.wait(0.2)
    assert bench.read(0x6041) & 0x1400 == 0x1400


def test_cst_accelerates_and_limits_the_torque(bench: Bench) -> None:
    bench.write(0x6072, 0, 50, 2)
    bench.enable(10)
    bench.write(0x6071, 0, 100, 2)
    bench.wait(5.0)
    assert bench.read(0x6077) == 50
    assert bench.drive.axis.velocity == pytest.approx(50 / 10 / 2 * TURN, rel=0.01)


def test_profile_position_handshake_and_buffer(bench: Bench) -> None:
    bench.enable(1)
    for target in (200_000, 150_000):
        bench.write(0x607A, 0, target)
        bench.control(0x1F)
        assert bench.read(0x6041) & 0x1400 == 0x1000
        bench.control(0x0F)
        bench.wait(0.01)
        buffered = target == 150_000
        assert bool(bench.read(0x6041) & 0x1000) == buffered
    bench.wait(5.0)
    assert bench.read(0x6064) == 150_000
    assert bench.read(0x6041) & 0x1400 == 0x400
    assert bench.drive.axis.max_velocity <= TURN
    bench.write(0x607A, 0, -50_000)
    bench.control(0x7F)
    bench.control(0x0F)
    bench.wait(3.0)
    assert bench.read(0x6064) == 100_000


def test_profile_position_takes_the_target_of_the_same_pdo(bench: Bench) -> None:
    bench.write(0x1400, 1, INVALID | 0x200 + NODE)
    bench.write(0x1600, 0, 0, 1)
    bench.write(0x1600, 1, 0x6040_0010)
    bench.write(0x1600, 2, 0x607A_0020)
    bench.write(0x1600, 0, 2, 1)
    bench.write(0x1400, 1, 0x200 + NODE)
    bench.nmt(1)
    bench.enable(1)
    bench.send(0x200 + NODE, struct.pack("<Hi", 0x1F, 130_000))
    bench.send(0x200 + NODE, struct.pack("<Hi", 0x0F, 140_000))
    bench.wait(2.0)
    assert bench.read(0x6064) == 130_000


@pytest.mark.parametrize(("method", "home"), [(33, TURN), (34, 2 * TURN), (35, None), (37, None)])
def test_homing(bench: Bench, method: int, home: int | None) -> None:
    bench.write(0x6098, 0, method, 1)
    bench.write(0x607C, 0, 500)
    bench.enable(6)
    assert bench.read(0x6041) & 0x3400 == 0x400
    bench.control(0x1F)
    bench.wait(0.1 if home is None else 0.3)
    assert bool(bench.read(0x6041) & 0x1000) == (home is None)
    bench.wait(4.0)
    assert bench.read(0x6041) & 0x3400 == 0x1400
    axis = bench.drive.axis
    assert axis.counts_at_zero == (123_456 if home is None else home) - 500
    assert bench.drive[0x6064] == round(axis.position - axis.counts_at_zero)


def test_position_uses_the_factor_group() -> None:
    bench = Bench(power_on_position=3 * TURN, feed=3600)
    bench.wait(0.1)
    assert bench.read(0x6064) == 3 * 3600
    bench.write(0x6091, 1, 4)
    bench.wait(0.01)
    assert bench.read(0x6064) == 3 * 900
