"""Environment in which an arm is to carry an object over a table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from robotd.api import FloatArray, InvalidArgument, World
from robotd.api.robots import Gripper
from robotd_gym.joint_reach import FAST, ROOM, SPEED, Observation
from robotd_gym.stepped_robot import SteppedRobot, finite_numbers, positive_number

AREA_M = ((0.30, 0.45), (-0.25, 0.25))  # x and y of random places, in the frame of the world
APART_M = 0.1  # between object and goal, at least
FAR_M = 100.0  # bound of positions in observations
LIFTED_M = 0.005  # above its height at the start: below it an object lies, above it is carried
REST_M_S = 0.01  # of an object that lies


class PickAndPlace(gymnasium.Env[Observation, FloatArray]):
    """Carry an object to a goal, on a backend with contacts.

    The action (n + 1,) is the change of the commanded positions, -1 to 1 as in ``JointReach``, and
    the gripper: above 0 it closes. Observations are arrays: ``position``, ``velocity`` and
    ``command`` (n,) of the joints, ``gripper`` (1,) from 0 (open) to 1, ``tool`` (3,) and
    ``object`` (7,) in the frame of the world, ``object_velocity`` (3,), its mean velocity in the
    last step in m/s, and ``goal`` (2,), x and y in m. The reward is the
    negative distance from tool to object plus that from object to goal, in m. An episode
    terminates when the object was lifted, and the open gripper has left it at rest on the table,
    within ``tolerance`` of the goal; ``info["is_success"]`` is True then.

    The simulation is stepped: the same seed and actions give the same episode, bit for bit.

    Args:
        robot, variant, rate_hz: as for ``SteppedRobot``.
        backend: one with a world.
        tolerance: of x and y of the object, m.
        camera: its picture is ``image`` of the observation; "": none.
        render_mode: ``rgb_array``: ``render`` returns the picture of ``camera``, or of the first
            one of the world; None: it returns None.

    Attributes:
        joint_names: of the robot.
        stepped: the robot, for environments that are derived from this one.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as gymnasium declares it
        "render_modes": ["rgb_array"],
        "render_fps": 25,
    }

    def __init__(
        self,
        robot: str | Path = "cr3a",
        variant: str | None = None,
        rate_hz: float = 25.0,
        backend: str = "mujoco",
        object_name: str = "cube",
        tolerance: float = 0.02,
        camera: str = "",
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InvalidArgument(f"render_mode is {render_mode!r} (available: rgb_array)")
        self.render_mode = render_mode
        self.stepped = stepped = SteppedRobot(robot, variant, rate_hz, backend)
        self.joint_names = stepped.joint_names
        self._object, self._camera = object_name, camera
        self._tolerance = positive_number(tolerance, "tolerance")
        self._largest_change = SPEED * stepped.velocity_limits * stepped.period_s
        joints = len(self.joint_names)
        self._command, self._goal = np.zeros(joints), np.zeros(2)
        self._start, self._place = np.zeros(7), np.zeros(7)
        self._was_lifted = False
        room = ROOM * (stepped.upper - stepped.lower)
        fast = FAST * stepped.velocity_limits
        self.action_space = Box(-1.0, 1.0, (joints + 1,), np.float64)
        spaces: dict[str, Any] = {
            "position": Box(stepped.lower - room, stepped.upper + room, dtype=np.float64),
            "velocity": Box(-fast, fast, dtype=np.float64),
            "command": Box(stepped.lower, stepped.upper, dtype=np.float64),
            "gripper": Box(-0.5, 1.5, (1,), np.float64),
            "tool": Box(-FAR_M, FAR_M, (3,), np.float64),
            "object": Box(-FAR_M, FAR_M, (7,), np.float64),
            "object_velocity": Box(-FAR_M, FAR_M, (3,), np.float64),
            "goal": Box(-FAR_M, FAR_M, (2,), np.float64),
        }
        if camera:
            stepped.reset()
            shapes = {
                camera.name: (camera.height, camera.width, 3) for camera in self._world.cameras
            }
            if camera not in shapes:
                known = ", ".join(shapes) or "none"
                raise InvalidArgument(f"camera {camera!r} is unknown (available: {known})")
            spaces["image"] = Box(0, 255, shapes[camera], np.uint8)
        self.observation_space = Dict(spaces)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a new robot; draw the place of the object and the goal.

        Args:
            seed: of the places and the simulated noise; None: continue the random numbers.
            options: ``object`` and ``goal``: x and y in m, instead of random ones.

        Raises InvalidArgument: one of them is not two finite numbers.
        """
        super().reset(seed=seed)
        self.stepped.reset(int(self.np_random.integers(2**31)))
        given = options or {}
        place, goal = self._draw()
        place = finite_numbers(given.get("object", place), 2, "object")
        self._goal = finite_numbers(given.get("goal", goal), 2, "goal")
        self._start = self._pose()
        self._start[:2] = place
        self._world.place(self._object, self._start)
        self._place, self._was_lifted = self._start.copy(), False
        self._command = self._within_limits(self.stepped.position)
        return self._observe(), {"is_success": False}

    def step(self, action: FloatArray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send the changed positions and the gripper, and let one period pass.

        Raises the errors of ``SteppedRobot.step``; InvalidArgument: the action is not n + 1
        finite numbers.
        """
        action = finite_numbers(action, len(self.joint_names) + 1, "action")
        closes = bool(action[-1] > 0.0)
        if closes != self._gripper.is_commanded_closed:
            self._gripper.command(closes)
        change = np.clip(action[:-1], -1.0, 1.0) * self._largest_change
        self._command = self._within_limits(self._command + change)
        self.stepped.step(self._command)
        observation = self._observe()
        place = observation["object"]
        to_object = float(np.linalg.norm(observation["tool"] - place[:3]))
        to_goal = float(np.linalg.norm(place[:2] - self._goal))
        is_down = abs(place[2] - self._start[2]) < LIFTED_M
        self._was_lifted |= not is_down
        rests = np.linalg.norm(observation["object_velocity"]) < REST_M_S
        is_left = not closes and observation["gripper"][0] < 0.1
        is_put_down = self._was_lifted and is_down and rests and is_left
        success = to_goal < self._tolerance and bool(is_put_down)
        return observation, -to_object - to_goal, success, False, {"is_success": success}

    def render(self) -> NDArray[np.uint8] | None:
        """Return the picture of the camera (height, width, 3); None without ``rgb_array``.

        Raises InvalidArgument: the world has no camera.
        """
        if self.render_mode is None:
            return None
        cameras = self._world.cameras
        if not cameras:
            raise InvalidArgument("render_mode rgb_array needs a camera in the world")
        return self._world.image(self._camera or cameras[0].name)

    def close(self) -> None:
        """Shut the robot down."""
        self.stepped.close()

    @property
    def _world(self) -> World:
        world = self.stepped.robot.world
        if world is None:
            backend = self.stepped.robot.backend.name
            raise InvalidArgument(f"the backend {backend} has no world")
        return world

    @property
    def _gripper(self) -> Gripper:
        gripper = self.stepped.robot.gripper
        if gripper is None:
            raise InvalidArgument(f"{self.stepped.robot.descriptor.name} has no gripper")
        return gripper

    def _pose(self) -> FloatArray:
        names = [item.name for item in self._world.objects]
        if self._object not in names:
            known = ", ".join(names) or "none"
            raise InvalidArgument(f"object {self._object!r} is unknown (available: {known})")
        pose: FloatArray = self._world.poses()[names.index(self._object)]
        return pose

    def _observe(self) -> Observation:
        robot = self.stepped.robot
        tool = robot.tools[0].frame(robot.image)
        before, self._place = self._place, self._pose()
        observation = {
            "position": self.stepped.position,
            "velocity": self.stepped.velocity,
            "command": self._command.copy(),
            "gripper": np.array([self._gripper.closed]),
            "tool": np.full(3, np.nan) if tool is None else tool[:3, 3].copy(),
            "object": self._place.copy(),
            "object_velocity": (self._place[:3] - before[:3]) / self.stepped.period_s,
            "goal": self._goal.copy(),
        }
        if self._camera:
            observation["image"] = self._world.image(self._camera)
        return observation

    def _draw(self) -> tuple[FloatArray, FloatArray]:
        """Return two random places that are not too near to each other."""
        low, high = np.array(AREA_M).T
        place = self.np_random.uniform(low, high)
        goal = place
        while np.linalg.norm(goal - place) < APART_M:
            goal = self.np_random.uniform(low, high)
        return place, goal

    def _within_limits(self, position: FloatArray) -> FloatArray:
        clipped: FloatArray = np.clip(position, self.stepped.lower, self.stepped.upper)
        return clipped
