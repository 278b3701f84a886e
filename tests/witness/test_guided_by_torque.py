"""Hand guiding by torque: what drives with a link under gravity do, which know no model of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.plugins.independent.cia402_node import State
from tests.plugins.independent.servo_axis import CSP, CST
from tests.witness.bench import COUNTS_PER_RAD, TORQUE_LIMIT, Bench
from tests.witness.canopen_bench import CanopenBench
from tests.witness.ethercat_bench import EthercatBench
from tests.witness.tapped_drive import TappedDrive

from robotd.device.state import Operation
from robotd.errors import DescriptorError, NotReady, Unsupported
from robotd_teach.hand_guiding import HandGuiding

MASS_KG, LENGTH_M, AT_RAD = 2.0, 0.3, 0.4
DAMPING = {"guiding_damping_nm_s_rad": 0.5}
LINK = {
    "link_mass_kg": MASS_KG, "link_length_m": LENGTH_M, "link_counts_per_rad": COUNTS_PER_RAD,
    "power_on_position": round(AT_RAD * COUNTS_PER_RAD),
}  # fmt: skip
POSITION_ALONE = ["0x6040", "0x6060", "0x607A"]
GUIDED = int(Operation.GUIDING)
IDLE = int(Operation.IDLE)

JOINT = """
<link name="link{n}"><inertial><origin xyz="{length} 0 0"/><mass value="{mass}"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<joint name="joint{n}" type="revolute"><parent link="base"/><child link="link{n}"/>
  <origin xyz="0 {n} 0"/><axis xyz="0 -1 0"/>
  <limit lower="-3" upper="3" velocity="3.14" effort="10"/></joint>"""


class Links(Bench):
    """Two links side by side, each on an axis that is level."""

    drives: Sequence[TappedDrive]
    watched_s: float  # after which a drive stops by itself

    def __init__(self, folder: Path, mass_kg: float = MASS_KG, **options: Any) -> None:
        links = "".join(JOINT.format(n=n, mass=mass_kg, length=LENGTH_M) for n in (1, 2))
        self.urdf = folder / "links.urdf"
        self.urdf.write_text(f'<robot name="links"><link name="base"/>{links}</robot>')
        super().__init__(**{"drive": DAMPING, "rate_hz": 250.0, **LINK, **options})

    def describe(self, rate_hz: float, engine: dict[str, Any] | None = None) -> dict[str, Any]:
        return super().describe(rate_hz, engine) | {"urdf": str(self.urdf)}

    def start(self) -> None:
        with self.requested():
            self.robot.start()
            for axis in range(2):
                self.robot.axes.servo(axis, True)
        self.run(0.2)

    def guide(self) -> None:
        self.robot.axes.begin_guiding([0, 1])
        assert [drive[0x6061] for drive in self.drives] == [CST, CST]

    def speeds(self) -> list[float]:
        return [abs(drive.axis.velocity) / COUNTS_PER_RAD for drive in self.drives]

    def places(self) -> list[float]:
        return [drive.position_rad for drive in self.drives]

    def hand(self, torque_nm: float) -> None:
        for drive in self.drives:
            drive.knobs.external_torque_nm = torque_nm

    def watch(self, seconds: float) -> tuple[float, float]:
        """Run; return the highest speed and the largest step of a torque in a frame, rad/s, N·m."""
        fastest, step, before = 0.0, 0.0, [drive[0x6071] for drive in self.drives]
        for _ in range(round(seconds * 250)):
            self.run(0.004)
            now = [drive[0x6071] for drive in self.drives]
            fastest = max(fastest, *self.speeds())
            step = max(step, *(abs(a - b) for a, b in zip(now, before, strict=True)))
            before = now
        return fastest, step * 20.0 / 1000


class CanopenLinks(Links, CanopenBench):
    watched_s = 0.5


class EthercatLinks(Links, EthercatBench):
    watched_s = 0.1

    def __init__(self, folder: Path, mass_kg: float = MASS_KG, **options: Any) -> None:
        super().__init__(folder, mass_kg, **{"section": {"watchdog_ms": 100}, **options})


BUSES: dict[str, type[Links]] = {"canopen": CanopenLinks, "ethercat": EthercatLinks}
EACH_BUS = pytest.mark.parametrize("bus", BUSES)


@contextmanager
def started(bus: str, folder: Path, mass_kg: float = MASS_KG, **options: Any) -> Iterator[Links]:
    bench = BUSES[bus](folder, mass_kg, **options)
    try:
        bench.start()
        yield bench
    finally:
        bench.robot.shutdown()
        bench.close()


def require_held(bench: Links) -> None:
    """Run until both drives hold by position where they are, and require that they stay."""
    bench.run(0.5)
    assert [drive.power for drive in bench.drives] == [State.ENABLED, State.ENABLED]
    assert [drive[0x6061] for drive in bench.drives] == [CSP, CSP]
    assert bench.robot.image.operation.tolist() == [IDLE, IDLE]
    before = bench.places()
    bench.run(0.5)
    assert bench.places() == pytest.approx(before, abs=1e-4)
    assert bench.robot.image.position_command == pytest.approx(before, abs=1e-3)


@EACH_BUS
def test_a_guided_link_stays_and_follows_a_hand(bus: str, tmp_path: Path) -> None:
    with started(bus, tmp_path) as bench:
        bench.guide()
        fastest, step = bench.watch(2.0)
        assert fastest < 0.01
        assert step < 0.1
        assert bench.places() == pytest.approx([AT_RAD, AT_RAD], abs=0.01)
        assert (bench.robot.image.operation == GUIDED).all()
        bench.hand(1.0)
        bench.watch(0.8)
        moved = bench.places()
        assert min(moved) > AT_RAD + 0.2
        assert bench.robot.image.position_command == pytest.approx(bench.robot.image.position)
        bench.hand(0.0)
        bench.watch(3.0)
        assert max(bench.speeds()) < 0.05  # its damping, and no return
        assert min(bench.places()) > min(moved) - 0.01
        assert bench.findings == []


@EACH_BUS
def test_it_begins_with_the_torque_that_held_the_link(bus: str, tmp_path: Path) -> None:
    """The weight of the model is smaller; what is missing goes by and by."""
    with started(bus, tmp_path, mass_kg=0.8 * MASS_KG) as bench:
        held = bench.drives[0][0x6077]
        bench.guide()
        assert bench.drives[0][0x6071] == pytest.approx(held, abs=0.1 * held)
        bench.run(0.3)
        assert bench.drives[0][0x6071] < 0.93 * held


@EACH_BUS
def test_damping_brakes_what_a_hand_has_moved(bus: str, tmp_path: Path) -> None:
    travelled = []
    for damping in (0.0, 2.0):
        with started(bus, tmp_path, drive={"guiding_damping_nm_s_rad": damping}) as bench:
            bench.guide()
            bench.hand(1.0)
            bench.run(0.5)
            travelled.append(bench.places()[0] - AT_RAD)
    assert travelled[1] < 0.6 * travelled[0]


@EACH_BUS
@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("push_nm", [0.0, 1.5])
def test_a_stop_ends_it_at_rest_without_a_jump(
    bus: str, tmp_path: Path, push_nm: float, quick: bool
) -> None:
    with started(bus, tmp_path) as bench:
        bench.guide()
        bench.hand(push_nm)
        bench.run(0.4)
        bench.hand(0.0)
        speed, left = max(bench.speeds()), bench.places()
        assert (speed > 0.3) is bool(push_nm)
        for drive in bench.drives:
            drive.axis.max_step = 0.0
        (bench.robot.axes.quick_stop if quick else bench.robot.axes.stop)([0, 1])
        fastest, _ = bench.watch(0.5)
        assert fastest < speed + 0.05
        require_held(bench)
        assert bench.places() == pytest.approx(left, abs=0.05 * bool(push_nm) + 1e-3)
        assert max(drive.axis.max_step for drive in bench.drives) < 1e-3 * COUNTS_PER_RAD
        bench.guide()  # and again
        bench.run(0.5)
        assert max(bench.speeds()) < 0.01
        assert bench.findings == []


@EACH_BUS
def test_the_target_is_the_measured_position_before_the_mode_is_changed(
    bus: str, tmp_path: Path
) -> None:
    with started(bus, tmp_path) as bench:
        bench.guide()
        bench.hand(1.5)
        bench.run(0.4)
        bench.hand(0.0)
        bench.robot.axes.stop([0, 1])
        drive, seen = bench.drives[0], list[tuple[State, float]]()
        for _ in range(200):
            mode = drive[0x6060]
            bench.run(0.004)
            if mode == CST and drive[0x6060] == CSP:
                seen.append((drive.power, abs(drive[0x607A] - drive[0x6064]) / COUNTS_PER_RAD))
        [(power, away)] = seen
        assert power is State.QUICK_STOP
        assert away < 1e-3


@EACH_BUS
def test_a_link_of_another_mass_falls_and_is_caught(bus: str, tmp_path: Path) -> None:
    with started(bus, tmp_path, mass_kg=0.5 * MASS_KG) as bench:
        guiding = bench.robot.feature(HandGuiding)
        guiding.begin()
        fastest, _ = bench.watch(1.5)
        assert 1.5 < fastest < 2.5
        assert "was moved at" in guiding.reason
        assert min(bench.places()) > AT_RAD - 0.5
        require_held(bench)


FAULTS: dict[str, Callable[[Links], None]] = {
    "deaf": lambda bench: bench.silence(0.1, [0], "commands"),
    "mute": lambda bench: bench.silence(0.1, [0], "answers"),
    "short": lambda bench: bench.silence(0.03, [0], "answers"),
    "silent": lambda bench: bench.silence(0.1, [0]),
    "lost": lambda bench: bench.silence(5.0, [0]),
    "all": lambda bench: bench.silence(0.1),
    "trip": lambda bench: bench.trip(0),
    "off": lambda bench: bench.robot.axes.servo(0, False),
}


@EACH_BUS
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_ends_it_for_all(bus: str, tmp_path: Path, fault: str) -> None:
    with started(bus, tmp_path) as bench:
        guiding = bench.robot.feature(HandGuiding)
        guiding.begin()
        bench.hand(1.0)
        bench.run(0.2)
        FAULTS[fault](bench)
        bench.run(0.1)
        bench.hand(0.0)
        assert guiding.reason
        bench.run(1.0)
        assert not (bench.robot.image.operation == GUIDED).any()
        for drive in bench.drives:
            assert drive[0x6061] != CST or drive.power is not State.ENABLED
        assert max(bench.speeds()) < 0.01
        assert bench.findings == []
        bench.heal()


@EACH_BUS
def test_a_stalled_control_loop_does_not_run_away(bus: str, tmp_path: Path) -> None:
    with started(bus, tmp_path) as bench:
        bench.guide()
        bench.stall(0.6 * bench.watched_s)
        bench.run(0.2)
        assert max(bench.speeds()) < 0.05
        assert bench.places() == pytest.approx([AT_RAD, AT_RAD], abs=0.02)


@EACH_BUS
def test_a_guided_drive_stops_by_itself_without_robotd(bus: str, tmp_path: Path) -> None:
    with started(bus, tmp_path) as bench:
        bench.guide()
        bench.hand(1.0)
        bench.stall(2.0 * bench.watched_s)
        assert [drive.power for drive in bench.drives] == [State.FAULT, State.FAULT]
        bench.hand(0.0)
        bench.run(0.5)
        assert max(bench.speeds()) < 0.01


@EACH_BUS
def test_no_torque_is_beyond_the_limit(bus: str, tmp_path: Path) -> None:
    with started(bus, tmp_path, drive={"guiding_damping_nm_s_rad": 20.0}) as bench:
        bench.guide()
        bench.hand(-14.0)
        largest = 0.0
        for _ in range(50):
            bench.run(0.004)
            largest = max(largest, *(abs(drive[0x6071]) / 50 for drive in bench.drives))
        assert largest == pytest.approx(TORQUE_LIMIT, abs=0.02)
        assert bench.findings == []


@EACH_BUS
def test_a_weight_beyond_the_limit_is_not_guided(bus: str, tmp_path: Path) -> None:
    with started(bus, tmp_path, mass_kg=5.0) as bench:
        with pytest.raises(NotReady, match=r"its weight takes 13.5 N·m .*limit is 10"):
            bench.robot.axes.begin_guiding([0, 1])
        assert bench.drives[0][0x6061] == CSP


@pytest.mark.parametrize(
    ("bus", "knobs", "reason"),
    [
        ("canopen", {"absent": (0x6007,)}, "0x6007"),
        ("canopen", {"rejected": (0x1016,)}, "0x1016"),
        ("ethercat", {"absent": (0x6007,)}, "0x6007"),
    ],
)
def test_a_drive_that_need_not_stop_by_itself_is_not_guided(
    bus: str, tmp_path: Path, knobs: dict[str, Any], reason: str
) -> None:
    with started(bus, tmp_path, **knobs) as bench:
        with pytest.raises(NotReady, match=f"would keep its torque .*{reason}"):
            bench.robot.axes.begin_guiding([0, 1])
        assert bench.drives[0][0x6061] == CSP


@EACH_BUS
def test_without_the_key_nothing_is_guided(bus: str, tmp_path: Path) -> None:
    with (
        started(bus, tmp_path, drive={}) as bench,
        pytest.raises(Unsupported, match="hand guiding"),
    ):
        bench.robot.axes.begin_guiding([0])


@EACH_BUS
def test_a_drive_without_the_mode_does_not_start(bus: str, tmp_path: Path) -> None:
    with pytest.raises(Exception, match="guiding_damping_nm_s_rad needs cyclic_torque"):
        started(bus, tmp_path, supported_modes=0x1A5).__enter__()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"mass_kg": 0.0}, "takes the masses of all links; none has link1, link2"),
        ({"section": {"heartbeat_timeout_s": 2.0}}, "keeps its torque for so long"),
        ({"drive": {**DAMPING, "rpdos": [{"number": 1, "objects": POSITION_ALONE}]}},
         r"hand guiding takes 0x6071 \(target torque\) in a PDO of each SYNC"),
    ],
)  # fmt: skip
def test_the_check_names_what_is_missing(
    tmp_path: Path, options: dict[str, Any], reason: str
) -> None:
    with pytest.raises(DescriptorError, match=reason):
        CanopenLinks(tmp_path, **options)


@pytest.mark.parametrize("watchdog_ms", [None, 2000])
def test_the_check_names_a_watchdog_that_is_not_known_or_late(
    tmp_path: Path, watchdog_ms: float | None
) -> None:
    with pytest.raises(DescriptorError, match="watchdog_ms: give at most 1000"):
        EthercatLinks(tmp_path, section={"watchdog_ms": watchdog_ms})
