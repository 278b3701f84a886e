"""An arm on MuJoCo in stepped time: it moves, grips, and says where things are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from robotd.arrays import FloatArray
from robotd.clock.simulated import SteppedClock
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_mujoco.physics import Physics

# Poses of cr3a whose fingers are beside a cube on the table, and 100 mm above.
LEFT = (0.6, -0.11370677, -1.8616441, 0.40456556, 1.57079633, 2.17079633)
LEFT_ABOVE = (0.6, -0.04622459, -1.48981195, -0.03474877, 1.57079633, 2.17079633)
RIGHT, RIGHT_ABOVE = (-0.6, *LEFT[1:]), (-0.6, *LEFT_ABOVE[1:])
CUBE_M, CARRIED_M = (0.3684, 0.0966, 0.12), (0.2236, -0.3085, 0.12)
CLOSED_M, OPEN_M = 0.045, 0.0


class Cell:
    """A started robot and its physics.

    Attributes:
        robot, physics: as they are.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.physics: Physics = robot.device.physics

    def go(self, positions: Sequence[float], seconds: float) -> TrajectoryExecution:
        """Follow a trajectory of one point to its end, whatever that is."""
        robot = self.robot
        request = TrajectoryRequest.from_rows(robot.joint_names, [seconds], [list(positions)])
        with robot.follower.follow(request, robot.follower.tolerances([])) as execution:
            while not execution.done:
                robot.step(1)
        return execution

    def grip(self, *, closed: bool) -> None:
        """Close or open the gripper, and wait until the fingers rest."""
        assert self.robot.gripper is not None
        state = self.robot.gripper.move(CLOSED_M if closed else OPEN_M, lambda: False)
        assert state.at_rest

    def carry(self) -> None:
        """Carry what is at the left place to the right one."""
        for positions, seconds in ((LEFT_ABOVE, 2.0), (LEFT, 1.0)):
            self.go(positions, seconds)
        self.grip(closed=True)
        for positions, seconds in ((LEFT_ABOVE, 1.0), (RIGHT_ABOVE, 1.5), (RIGHT, 1.0)):
            self.go(positions, seconds)
        self.grip(closed=False)
        self.go(RIGHT_ABOVE, 1.0)

    def pose(self, name: str) -> FloatArray:
        """Return the pose (7,) of an object."""
        assert self.robot.world is not None
        names = [item.name for item in self.robot.world.objects]
        pose: FloatArray = self.robot.world.poses()[names.index(name)]
        return pose


@contextmanager
def cell(*overrides: str, robot: str = "cr3a", start: bool = True) -> Iterator[Cell]:
    """Run a robot on MuJoCo; ``overrides`` are ``key=value`` below ``backends.mujoco``."""
    values = [parse_override(f"backends.mujoco.{override}") for override in overrides]
    descriptor = load_robot_descriptor(robot, overrides=values)
    made = Robot(descriptor, load_backend("mujoco"), SteppedClock())
    try:
        if start:
            made.start()
        yield Cell(made)
    finally:
        made.shutdown()
