"""A simulated arm in one thread, observed by a tap whose thread does not run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from robotd.clock.simulated import SteppedClock
from robotd.motion import TrajectoryRequest
from robotd.observation.tap import Tap
from robotd.robot import Robot, build_robot
from robotd_recorder.recorder import FlightRecorder
from robotd_recording.recording_folder import RecordingFolder

PERIODS = 500


class Observed:
    """A robot on the simulation, its tap and its flight recorder."""

    def __init__(self, folder: Path, after_s: float = 0.5, robot: str = "cr3a") -> None:
        self.robot: Robot = build_robot(robot, "sim", clock=SteppedClock())
        self.tap = Tap(self.robot, 5.0)
        self.folder = folder
        kept = RecordingFolder(folder, self.robot.descriptor.name, 3, 100e6)
        self.flight = FlightRecorder(self.tap, kept, after_s)
        self.tap.add_reader(self.flight.check)
        self.robot.start()
        self.step()

    def step(self, seconds: float = 0.1) -> None:
        """Let time pass and observe what happened."""
        for _ in range(max(1, round(seconds / 0.1))):
            self.robot.step(50)
            self.tap.observe()

    def goal(self, positions: list[float], seconds: float = 1.0, **options: Any) -> Any:
        request = TrajectoryRequest.from_rows(self.robot.joint_names, [seconds], [positions])
        return self.robot.follower.follow(request, **options)

    def files(self) -> list[Path]:
        return sorted(self.folder.glob("*"))

    def close(self) -> None:
        self.robot.shutdown()
        self.flight.close()
