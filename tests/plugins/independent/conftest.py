"""Robots of one joint, each on an independent drive in another process."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from tests.plugins.independent.cia402_node import ServoDrive
from tests.plugins.independent.harness import NodeProcess
from tests.plugins.independent.knobs import Knobs

from robotd.clock import MonotonicClock, wait_until
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.descriptor import load_robot_descriptor
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot

GROUP, NODE = "239.74.163.12", 5
RATE_HZ = 100
COUNTS_PER_RAD = 10_000
START_RAD = 1.5  # where the drive is at power-on
SPEED_RAD_S = 2.0
TPDOS = [
    {"number": 1, "objects": ["0x6041", "0x6061", "0x6064"]},
    {"number": 2, "objects": ["0x606C", "0x6077", "0x603F"]},
]
# One bus for each process of tests, apart from that of the simulated drives: python-can hears every
# group of a port.
PORT = 40_000 + os.getpid() % 20_000


class Bench:
    """One drive in its own process, and a robot for it that is not yet started."""

    def __init__(self, drive: NodeProcess, robot: Robot) -> None:
        self.drive, self.robot, self.image = drive, robot, robot.image
        self.bus = ["--interface", "udp_multicast", "--channel", f"{GROUP}#{PORT}"]

    def until(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        assert wait_until(condition, timeout_s, MonotonicClock())

    @contextmanager
    def moving(self, target: float, seconds: float) -> Iterator[TrajectoryExecution]:
        request = TrajectoryRequest.from_rows(self.robot.joint_names, [seconds], [[target]])
        with self.robot.follower.follow(request) as execution:
            yield execution

    def move(self, target: float, seconds: float = 0.6) -> TrajectoryExecution:
        with self.moving(target, seconds) as execution:
            assert execution.wait(seconds + 10)
        return execution

    def has_jumped(self) -> bool:
        """Return whether the drive was commanded or has moved faster than the joint may."""
        measured = self.drive.ask()
        # On a busy computer several periods may pass between two setpoints, and the drive
        # interpolates each within one period. A jump has the highest speed of the drive.
        far = measured["max_step"] > 0.3 * COUNTS_PER_RAD
        return bool(far or measured["max_velocity"] >= Knobs.max_speed)


OpenBench = Callable[..., AbstractContextManager[Bench]]


@pytest.fixture(scope="session")
def drive() -> Iterator[NodeProcess]:
    with NodeProcess(GROUP, NODE, port=PORT) as process:
        yield process


@pytest.fixture
def open_bench(tmp_path: Path, drive: NodeProcess) -> OpenBench:
    """``open_bench(knobs..., axis={...}, section={...})``: a drive with habits, and its robot.

    ``dcf``: values by the section of the EDS, which becomes a DCF.
    """

    @contextmanager
    def opened(
        axis: dict[str, Any] | None = None,
        section: dict[str, Any] | None = None,
        dcf: dict[str, str] | None = None,
        engine: dict[str, Any] | None = None,
        **knobs: Any,
    ) -> Iterator[Bench]:
        habits = Knobs(**{"power_on_position": round(START_RAD * COUNTS_PER_RAD), **knobs})
        path = write_robot(tmp_path, habits, axis or {}, section or {}, dcf or {}, engine or {})
        drive.power_on(habits)
        robot = Robot(load_robot_descriptor(str(path)), load_backend("canopen"), MonotonicClock())
        try:
            yield Bench(drive, robot)
        finally:
            robot.shutdown()

    return opened


def write_robot(
    folder: Path,
    habits: Knobs,
    axis: dict[str, Any],
    section: dict[str, Any],
    dcf: dict[str, str],
    engine: dict[str, Any],
) -> Path:
    eds = ServoDrive(NODE, lambda _: None, habits).eds(NODE)
    for name, value in dcf.items():
        assert f"[{name}]\n" in eds
        eds = eds.replace(f"[{name}]\n", f"[{name}]\nParameterValue={value}\n")
    (folder / "drive.eds").write_text(eds, encoding="utf-8")
    described = {"axis": 0, "node": NODE, "eds": "drive.eds", "counts_per_rad": COUNTS_PER_RAD}
    options = {"port": PORT, "hop_limit": 0}
    joint = {"name": "joint1", "axis": 0, "lower_rad": -3.0, "upper_rad": 3.0}
    joint |= {"velocity_rad_s": SPEED_RAD_S, "acceleration_rad_s2": 10.0, "rated_torque_nm": 20}
    content = {
        "schema": 1,
        "name": "one_drive",
        "summary": "one joint on an independent drive",
        "axes": 1,
        "cycle": {"rate_hz": RATE_HZ},
        "engine": {"stale_after_s": 5.0, "open_tries": 1, **engine},
        "joints": [joint],
        "trajectory": {"path_tolerance_rad": 3.0},  # what a stall has led off its path goes back
        "backend": "canopen",
        "backends": {
            "canopen": {
                "bus": {"interface": "udp_multicast", "channel": GROUP, "options": options},
                "heartbeat_timeout_s": 10.0,
                "stream_timeout_s": 10.0,
                **section,
                "axes": [{**described, "tpdos": TPDOS, **axis}],
            }
        },
    }
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path
