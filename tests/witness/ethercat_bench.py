"""Robot of joints on independent EtherCAT slaves, in simulated time."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from select import select
from time import monotonic
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from tests.plugins.independent.canopen_objects import DEVICE_STATE
from tests.witness.bench import (
    COUNTS_PER_RAD,
    OVERCURRENT,
    Bench,
    knobs_of,
)
from tests.witness.ethercat_slave import EthercatSlave
from tests.witness.soem_standin import Cable, library

from robotd.clock import NANOSECONDS
from robotd.descriptor import RobotDescriptor
from robotd.device.capabilities import Capability
from robotd.errors import RobotdError
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_ethercat.supervision import Supervision

REFUSED = (0x6060, 0x607A, 0x60C2, 0x6007, 0x6085)  # by a busy drive, once each
CHECK_S, SEARCH_S = 1.0, 0.05  # between two looks of the watch thread


def at_once(*ends: Any) -> Any:
    """``select`` without its time-out."""
    readable, writable, failed, _ = ends
    return select(readable, writable, failed, 0.0)


class EthercatBench(Bench):
    """A robot that is not yet started, on its cable; ``close`` when it is not needed any more."""

    def __init__(
        self,
        axes: int = 2,
        rate_hz: float = 250.0,
        engine: dict[str, Any] | None = None,
        section: dict[str, Any] | None = None,
        base: bool = False,
        drive: dict[str, Any] | None = None,
        **knobs: Any,
    ) -> None:
        self.prepare(axes, rate_hz, base=base)
        self.cable = Cable(lambda: self.clock.now_ns() / NANOSECONDS)
        self.cable.sleep = self.run
        for judge in self.judges:
            judge.may_wait = 1
        self.slaves = [
            EthercatSlave(knobs_of(**knobs), judge, COUNTS_PER_RAD) for judge in self.judges
        ]
        self.drives = [slave.drive for slave in self.slaves]
        self.cable.slaves = self.slaves
        self._check_s = 0.0
        self.clock.advanced = self.settle
        self._patches = ExitStack()
        for target, value in (
            ("robotd_ethercat.soem._library", lambda: library(self.cable)),
            ("robotd_ethercat.soem.problem_of", lambda _: ("", False)),
            ("robotd_ethercat.soem.raw_sockets", self._raw_sockets),
            ("robotd_ethercat.soem.prepared", self._prepared),
            # What has not come by now does not come in real time.
            ("robotd_ethercat.soem.select", SimpleNamespace(select=at_once)),
            ("robotd_ethercat.soem.time", SimpleNamespace(sleep=int, monotonic=monotonic)),
        ):
            self._patches.enter_context(patch(target, value))
        # The watch thread works in real time: ``settle`` does what it does.
        self._patches.enter_context(patch.object(Supervision, "begin", lambda _: None))
        self.run(0.1)
        self._engine, self._section, self._rate_hz = engine or {}, section or {}, rate_hz
        self._drive = drive or {}
        try:
            self.robot = self.make_robot()
        except BaseException:
            self.close()  # nobody else can: the stand-in of the library would remain
            raise

    def make_robot(self) -> Robot:
        axes = len(self.drives)
        descriptor = RobotDescriptor.model_validate({
            **self.describe(self._rate_hz, self._engine),
            "backend": "ethercat",
            "backends": {"ethercat": {
                "interface": "eth0", **self._section,
                "axis_defaults": {
                    "counts_per_rad": COUNTS_PER_RAD, "velocity_mode": "csv", **self._drive,
                },
                "axes": [{"axis": axis, "slave": axis} for axis in range(axes)],
            }},
        })  # fmt: skip
        backend = load_backend("ethercat")
        backend.capabilities |= {Capability.SIMULATED}  # here: slaves and bus use this clock
        self._sockets: Iterator[set[int]] = iter(())
        robot = self.take(Robot(descriptor, backend, self.clock))
        self.master = vars(robot.connection._driver)["wrapped"].master
        return robot

    def close(self) -> None:
        self._patches.close()
        self.cable.close()

    def unplug(self) -> None:
        self.master.bus.close()

    def _raw_sockets(self) -> set[int]:
        """Return nothing before the library opens its socket, and the socket after that."""
        with suppress(StopIteration):
            return next(self._sockets)
        self._sockets = iter([{self.cable.master_end.fileno()}])
        return set()

    @staticmethod
    def _prepared(descriptor: int) -> socket.socket:
        copy = socket.socket(fileno=os.dup(descriptor))
        copy.setblocking(False)
        return copy

    def silence(self, seconds: float, axes: Sequence[int] = (), how: str = "both") -> None:
        """Lose process data to (``commands``) or from (``answers``) the slaves; axes: of these."""
        until_s = self.cable.now_s() + seconds
        if axes:
            for axis in axes:
                self.slaves[axis].silent_s = until_s
        elif how == "answers":
            self.cable.mute_s = until_s
        else:
            self.cable.deaf_s = until_s

    def delay(self, seconds: float, delay_s: float, axes: Sequence[int] = ()) -> None:
        self.cable.slow_s, self.cable.delay_s = self.cable.now_s() + seconds, delay_s

    def block(self, seconds: float) -> None:
        self.cable.blocked_s = self.cable.now_s() + seconds

    def reset(self, axis: int) -> None:
        self.slaves[axis].power_cycle()

    def trip(self, axis: int) -> None:
        self.drives[axis].fault(OVERCURRENT)

    def refuse(self, axis: int) -> None:
        self.slaves[axis].hung_s = self.cable.now_s() + 0.05
        self.slaves[axis].aborts |= dict.fromkeys(REFUSED, DEVICE_STATE)

    def heal(self) -> None:
        cable = self.cable
        cable.deaf_s = cable.mute_s = cable.slow_s = cable.blocked_s = 0.0
        cable.cut_at = None
        for slave in self.slaves:
            slave.silent_s = slave.hung_s = 0.0
            slave.aborts.clear()

    def settle(self) -> None:
        """Let the slaves live up to the present, and the watch thread look."""
        self.cable.advance()
        if not hasattr(self, "master"):
            return
        supervision, now = self.master.supervision, self.cable.now_s()
        due = self.master.state.name in {"COMMUNICATING", "UNKNOWN"}
        if due and (supervision._wake.is_set() or now >= self._check_s):
            supervision._wake.clear()
            with suppress(RobotdError):
                supervision.check()
                supervision._poll_mailbox()
            searching = supervision.lost or supervision.is_silent
            self._check_s = now + (SEARCH_S if searching else CHECK_S)
