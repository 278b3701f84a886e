"""Robot of joints on tapped CANopen drives, in simulated time."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from tests.plugins.independent.knobs import Knobs
from tests.witness.bench import (
    COUNTS_PER_RAD,
    OVERCURRENT,
    Bench,
    knobs_of,
)
from tests.witness.can_line import Line
from tests.witness.tapped_drive import TappedDrive

from robotd.clock import NANOSECONDS
from robotd.descriptor import load_robot_descriptor
from robotd.device.capabilities import Capability
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

FIRST_NODE = 5
LATE_SETPOINTS = 3  # that may wait in an adapter which cannot discard them
RPDOS = [
    {"number": 1, "objects": ["0x6040", "0x6060", "0x607A"]},
    {"number": 2, "objects": ["0x60FF", "0x6071"]},
]
TPDOS = [
    {"number": 1, "objects": ["0x6041", "0x6061", "0x6064"]},
    {"number": 2, "objects": ["0x606C", "0x6077", "0x603F"]},
]
MODES = (0x6060, 0x6061)
MODE_DELAY_S = 0.015  # more than a period
_numbers = itertools.count()


class CanopenBench(Bench):
    """A robot that is not yet started, on its line.

    Args:
        engine, section, drive: further keys of ``engine``, ``backends.canopen`` and its axes.
        keeps: the adapter cannot discard frames that wait to be sent.
        base: there are wheels after the joints.
        mode_by_sdo: no PDO of the drives holds the mode or its display.
    """

    def __init__(
        self,
        axes: int = 2,
        rate_hz: float = 250.0,
        engine: dict[str, Any] | None = None,
        section: dict[str, Any] | None = None,
        drive: dict[str, Any] | None = None,
        keeps: bool = False,
        base: bool = False,
        mode_by_sdo: bool = False,
        **knobs: Any,
    ) -> None:
        self.prepare(axes, rate_hz, base=base)
        name = f"witness-{next(_numbers)}"
        self.line = Line(name, lambda: self.clock.now_ns() / NANOSECONDS)
        self._interface = "keeping" if keeps else "witness"
        self._let_wait()
        self._unmapped = MODES if mode_by_sdo else ()
        if mode_by_sdo:
            knobs = {"unmapped": MODES, "mode_delay_s": MODE_DELAY_S, **knobs}
        self.numbers: Sequence[int] = range(FIRST_NODE, FIRST_NODE + len(self.judges))
        self.drives: list[TappedDrive] = []
        for axis, node in enumerate(self.numbers):
            self._add(axis, node, knobs_of(**knobs))
        self.clock.advanced = self.settle
        self.run(0.1)
        self._name, self._engine = name, engine or {}
        self._section, self._drive = section or {}, drive or {}
        self._rate_hz = rate_hz
        self.robot = self.make_robot()

    def make_robot(self) -> Robot:
        axes = len(self.judges)
        description = self.describe(self._rate_hz, self._engine) | {
            "backend": "canopen",
            "backends": {"canopen": {
                "bus": {"interface": self._interface, "channel": self._name},
                "sdo_timeout_s": 0.03, "max_bus_load": 1.0, **self._section,
                "axis_defaults": {"eds": "drive.eds",
                                  "tpdos": self._mapped(TPDOS), "rpdos": self._mapped(RPDOS),
                                  "counts_per_rad": COUNTS_PER_RAD, **self._drive}
                | ({"velocity_mode": "csv"} if self.joints < axes else {}),
                "axes": [{"axis": axis, "node": n} for axis, n in enumerate(self.numbers)],
            }},
        }  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.yaml"
            eds = self.drives[0].eds(FIRST_NODE)
            (path.parent / "drive.eds").write_text(eds, encoding="utf-8")
            path.write_text(yaml.safe_dump(description), encoding="utf-8")
            backend = load_backend("canopen")
            backend.capabilities |= {Capability.SIMULATED}  # here: drives and bus use this clock
            return self.take(Robot(load_robot_descriptor(str(path)), backend, self.clock))

    def _mapped(self, pdos: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
        names = {f"0x{index:04X}" for index in self._unmapped}
        return [
            pdo | {"objects": [name for name in pdo["objects"] if name not in names]}
            for pdo in pdos
        ]

    def _add(self, axis: int, node: int, knobs: Knobs) -> None:
        def make(send: Any) -> TappedDrive:
            drive = TappedDrive(node, send, knobs, self.judges[axis], COUNTS_PER_RAD)
            self.drives.append(drive)
            return drive

        self.line.add(make)

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        nodes = [self.numbers[axis] for axis in axes]
        self.line.cut(seconds, nodes, deaf=how != "answers", mute=how != "commands")

    def _let_wait(self) -> None:
        for judge in self.judges:
            judge.may_wait = LATE_SETPOINTS if self._interface == "keeping" else 0

    def delay(self, seconds: float, delay_s: float, axes: Sequence[int] = ()) -> None:
        self.line.delay(seconds, delay_s, [self.numbers[axis] for axis in axes])
        if self._interface == "keeping":  # late answers count as those of SYNCs that wait
            for judge in self.judges:
                judge.may_wait = LATE_SETPOINTS + round(delay_s / judge.period_s)

    def block(self, seconds: float) -> None:
        self.line.block(seconds)

    def cut_cable(self, seconds: float) -> None:
        self.line.block(seconds)
        self.line.cut(seconds, deaf=False, mute=True)

    def reset(self, axis: int) -> None:
        self.drives[axis].restart()

    def trip(self, axis: int) -> None:
        self.drives[axis].fault(OVERCURRENT)

    def refuse(self, axis: int) -> None:
        self.drives[axis].knobs.sdo_missing = 2

    def heal(self) -> None:
        self.line.heal()
        self._let_wait()
        for drive in self.drives:
            drive.knobs.sdo_missing = 0

    def unplug(self) -> None:
        if self.line.adapter is not None:
            self.line.adapter.shutdown()

    def settle(self) -> None:
        """Let the drives live up to the present, and their frames arrive."""
        self.line.advance()
        if self.line.adapter is not None:
            self.line.adapter.settle()
