"""Robots on simulated CANopen drives, each on a bus of its own."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from tests.plugins.canopen.bus.drives_process import PATIENCE, RATE_HZ, STALE_AFTER_S
from tests.plugins.canopen.bus.harness import Harness

from robotd.clock import MonotonicClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

SMALL = str(Path(__file__).parent / "three_drives.yaml")  # where six axes prove nothing more
_numbers = itertools.count()

OpenRig = Callable[..., AbstractContextManager[Harness]]


@pytest.fixture
def open_rig(tmp_path: Path) -> OpenRig:
    """A started robot with its drives in this process; further arguments are options.

    ``prepare`` is called before the start.
    Its time-outs are patient.
    """

    @contextmanager
    def opened(
        robot: str = "cr3a",
        *,
        enable: bool = True,
        engine: dict[str, float] | None = None,
        prepare: Callable[[Robot], None] = lambda robot: None,
        **options: object,
    ) -> Iterator[Harness]:
        descriptor = load_robot_descriptor(robot, None if robot == SMALL else "canopen_simulated")
        section = dict(descriptor.backends["canopen"])
        channel = f"{os.getpid()}-{next(_numbers)}"
        bus = {"interface": "virtual", "channel": channel}
        section |= {"bus": bus, "sync_period_s": 1 / RATE_HZ, **PATIENCE, **options}
        changed = {
            "backends": {"canopen": section},
            "cycle": descriptor.cycle.model_copy(update={"rate_hz": RATE_HZ}),
            "engine": descriptor.engine.model_copy(
                update={"stale_after_s": STALE_AFTER_S, **(engine or {})}
            ),
        }
        descriptor = descriptor.model_copy(update=changed)
        harness = Harness(Robot(descriptor, load_backend("canopen"), MonotonicClock()))
        try:
            prepare(harness.robot)
            harness.robot.start(enable=enable)
            yield harness
        finally:
            harness.robot.shutdown()

    return opened
