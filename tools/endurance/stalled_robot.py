"""Child process of ``stalls``: a robot that swings its joints and records its motors."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Self

import numpy as np

from robotd.arrays import FloatArray
from robotd.clock import MonotonicClock
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.descriptor import load_robot_descriptor
from robotd.device.process_image import ProcessImage
from robotd.errors import RobotdError
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_cia402.simulated import Motors
from robotd_servo_model.servo import Servo
from robotd_servo_model.world import ServoWorld
from robotd_sim.device import SimDevice

SWING_RAD = 0.8
SWING_S = 2.142  # a cubic from rest to rest: at most 0.56 rad/s and 1.05 rad/s²
REST_S = 0.05
WAIT_S = 30.0  # for a path that waits for its device


class MotorRecorder:
    """Motor positions of every tick of a simulated servo, apart from any control loop.

    Args:
        world: time and motors of the device.
        ahead_ns: monotonic time minus the device's time.

    Attributes:
        times_ns: monotonic time of each tick.
        positions, commands: (n_axes,) each.
    """

    def __init__(self, world: ServoWorld, ahead_ns: Callable[[], int] = lambda: 0) -> None:
        self.times_ns: list[int] = []
        self.positions: list[FloatArray] = []
        self.commands: list[FloatArray] = []
        self._world, self._run, self._ahead_ns = world, world.servo.run, ahead_ns
        world.servo.run = self._record  # type: ignore[method-assign]

    @classmethod
    def of_drives(cls, motors: Motors) -> Self:
        """Record simulated CiA 402 drives.

        Their clock counts SYNCs: it gets ahead where one in time follows a late one.
        """
        return cls(motors._world, lambda: motors._timing.time_ns - motors._clock.now_ns())

    def _record(self, tick: int, stop: int, check: Callable[[], bool] | None) -> tuple[int, bool]:
        servo: Servo = self._world.servo
        origin_ns = self._world.now_ns - tick * round(servo.tick_s * 1e9) + self._ahead_ns()
        for now in range(tick + 1, stop + 1):
            _, seen = self._run(now - 1, now, check)
            self.times_ns.append(origin_ns + now * round(servo.tick_s * 1e9))
            self.positions.append(servo.position.copy())
            self.commands.append(servo.command.copy())
            if seen:
                return now, True
        return stop, False

    def end(self) -> None:
        """Stop recording: closing the device resets its scaling, and with it the positions."""
        self._world.servo.run = self._run  # type: ignore[method-assign]

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "times_ns": np.array(self.times_ns),
            "positions": np.array(self.positions),
            "commands": np.array(self.commands),
        }


class PathRecorder:
    """Path of the first joint, at 1 ms, and times of goals that failed.

    Called with the image of each control period, it notes the trajectory time of ``execution``,
    which is at rest while a device holds its position in a stall.
    """

    def __init__(self) -> None:
        self.execution: TrajectoryExecution | None = None
        self._starts_ns: list[tuple[int, int]] = []  # now, and time of trajectory time 0
        self.times_ns: list[np.ndarray] = []
        self.velocities: list[FloatArray] = []
        self.failures: list[str] = []
        self.failed_ns: list[tuple[int, int]] = []

    def __call__(self, image: ProcessImage) -> None:
        if self.execution is not None:
            self._starts_ns.append((MonotonicClock.now_ns(), self.execution.start_ns))

    def add(self, execution: TrajectoryExecution) -> None:
        """Keep the path of ``execution``, which has ended."""
        self.execution = None
        noted_ns, starts_ns = np.array(self._starts_ns).T
        self._starts_ns.clear()
        times_ns = np.arange(noted_ns[0], noted_ns[-1], 1_000_000)
        start_ns = starts_ns[np.searchsorted(noted_ns, times_ns, "right") - 1]
        times_s = (times_ns - start_ns) * 1e-9
        inside = (times_s >= 0.0) & (times_s <= execution.trajectory.duration_s)
        self.times_ns.append(times_ns[inside])
        self.velocities.append(execution.trajectory.evaluate(times_s[inside])[1][:, 0])
        if execution.outcome is None or execution.outcome.name != "SUCCEEDED":
            self.failures.append(f"{execution.outcome}: {execution.message}")
            self.failed_ns.append((execution.start_ns, MonotonicClock.now_ns()))

    def arrays(self) -> dict[str, np.ndarray]:
        return {
            "path_times_ns": np.concatenate(self.times_ns),
            "path_velocities": np.concatenate(self.velocities),
            "goals": np.array(len(self.times_ns)),
            "failed_ns": np.array(self.failed_ns, np.int64).reshape(-1, 2),
            "failures": np.array(self.failures, dtype=np.str_),
        }


class PeriodRecorder:
    """Image of every control period."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, float, float]] = []

    def __call__(self, image: ProcessImage) -> None:
        self.rows.append((image.fresh_ns, float(image.position[0]), float(image.velocity[0])))

    def arrays(self) -> dict[str, np.ndarray]:
        return {"image": np.array(self.rows)}


def swing(robot: Robot, ending: threading.Event) -> PathRecorder:
    """Move all joints to and fro until ``ending``."""
    paths, target = PathRecorder(), SWING_RAD
    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "path", paths)
    while not ending.is_set():
        request = TrajectoryRequest.from_rows(
            robot.joint_names, [SWING_S], [[target] * len(robot.joint_names)]
        )
        with suppress(RobotdError), robot.follower.follow(request) as execution:
            paths.execution = execution
            execution.wait(SWING_S + WAIT_S)
            paths.add(execution)
        ending.wait(REST_S)
        target = SWING_RAD - target
    return paths


def main(robot_file: str, backend: str, out: Path) -> None:
    """Print "moving", swing until a line comes on stdin, write ``out`` (npz)."""
    descriptor = load_robot_descriptor(robot_file)
    robot = Robot(descriptor, load_backend(backend), MonotonicClock())
    device = robot.connection._driver.wrapped  # type: ignore[attr-defined]
    motors = MotorRecorder(device.simulation.world) if isinstance(device, SimDevice) else None
    periods, ending = PeriodRecorder(), threading.Event()
    robot.control_loop.every(descriptor.cycle.rate_hz, "record", periods)

    def wait_for_end() -> None:
        sys.stdin.readline()
        ending.set()

    try:
        robot.start()
        sys.stdout.write("moving\n")
        sys.stdout.flush()
        threading.Thread(target=wait_for_end, daemon=True).start()
        paths = swing(robot, ending)
        if motors is not None:
            motors.end()
    finally:
        robot.shutdown()
    arrays = {
        **paths.arrays(),
        **periods.arrays(),
        "missed": np.array(robot.control_loop.stats.missed),
    }
    np.savez(out, **arrays, **(motors.arrays() if motors else {}))  # type: ignore[arg-type]


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
