"""Environment in which the joints of a robot are to reach random positions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import NDArray

from robotd.api import FloatArray, InvalidArgument
from robotd_gym.stepped_robot import SteppedRobot, finite_numbers, positive_number

SPEED = 0.8  # share of the velocity limits at an action of 1: room to catch up
REACH = 0.9  # share of the range of a joint in which goals are
TURN_RAD = np.pi  # range of goals, to both sides, for joints without position limits
ROOM = 0.1  # share of the range by which a measured position may be beyond its limits
FAST = 2.0  # highest velocity that is measured, relative to the limits
STILL = 0.05  # velocity at the goal, relative to the limits

WIDTH, ROW, MARGIN, MARK = 320, 40, 6, 6  # of pictures, pixels
GREY, GREEN, BLUE = (226, 230, 235), (46, 160, 67), (31, 111, 235)

Observation = dict[str, Any]  # arrays by name


class JointReach(gymnasium.Env[Observation, FloatArray]):
    """Move all joints of a simulated robot to a random goal.

    The action (n,) is the change of the commanded positions, -1 to 1: at 1 a joint moves with
    ``SPEED`` of its velocity limit. Observations are dictionaries of arrays (n,) in the order of
    ``joint_names``: ``position`` and ``velocity`` as measured, ``command`` (the commanded
    positions) and ``goal``, in rad and rad/s or m and m/s. The reward is the negative root mean
    square of the distances. An episode terminates when each joint is within ``tolerance`` of its
    goal and at rest; ``info["is_success"]`` is True then.

    The simulation is stepped: the same seed and actions give the same episode, bit for bit.

    Args:
        robot, variant, rate_hz: as for ``SteppedRobot``.
        tolerance: distance at which a goal is reached, rad or m.
        render_mode: ``rgb_array``: ``render`` returns a picture; None: it returns None.

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
        tolerance: float = 0.02,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InvalidArgument(f"render_mode is {render_mode!r} (available: rgb_array)")
        self.render_mode = render_mode
        self.stepped = stepped = SteppedRobot(robot, variant, rate_hz)
        self.joint_names = stepped.joint_names
        self._tolerance = positive_number(tolerance, "tolerance")
        self._largest_change = SPEED * stepped.velocity_limits * stepped.period_s
        self._command = self._goal = np.zeros(len(self.joint_names))
        room = ROOM * (stepped.upper - stepped.lower)
        fast = FAST * stepped.velocity_limits
        self.action_space = Box(-1.0, 1.0, (len(self.joint_names),), np.float64)
        self.observation_space = Dict(
            position=Box(stepped.lower - room, stepped.upper + room, dtype=np.float64),
            velocity=Box(-fast, fast, dtype=np.float64),
            command=Box(stepped.lower, stepped.upper, dtype=np.float64),
            goal=Box(stepped.lower, stepped.upper, dtype=np.float64),
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a new robot and draw a goal.

        Args:
            seed: of the goals and the simulated noise; None: continue the random numbers.
            options: ``goal``: (n,) positions in rad or m instead of a random goal; beyond a limit
                the limit.

        Raises InvalidArgument: the goal is not one finite number for each joint.
        """
        super().reset(seed=seed)
        self.stepped.reset(int(self.np_random.integers(2**31)))
        goal = (options or {}).get("goal")
        drawn = self._draw_goal()
        count = len(self.joint_names)
        given = drawn if goal is None else finite_numbers(goal, count, "goal")
        self._goal = self._within_limits(given)
        self._command = self._within_limits(self.stepped.position)
        return self._observe(), {"is_success": False}

    def step(self, action: FloatArray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send the changed positions and let one period pass.

        Raises the errors of ``SteppedRobot.step``; InvalidArgument: the action is not one finite
        number for each joint.
        """
        action = finite_numbers(action, len(self.joint_names), "action")
        change = np.clip(action, -1.0, 1.0) * self._largest_change
        self._command = self._within_limits(self._command + change)
        self.stepped.step(self._command)
        observation = self._observe()
        distance = observation["position"] - self._goal
        at_rest = np.abs(observation["velocity"]) < STILL * self.stepped.velocity_limits
        reached = bool(((np.abs(distance) < self._tolerance) & at_rest).all())
        reward = -float(np.sqrt(np.mean(distance**2)))
        return observation, reward, reached, False, {"is_success": reached}

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (height, ``WIDTH``, 3) of the joints; None without ``rgb_array``.

        Each joint is a bar over its range: the position in blue, the goal in green.
        """
        if self.render_mode is None:
            return None
        lower, upper = self._range()
        picture = np.full((len(self._goal) * ROW, WIDTH, 3), 255, np.uint8)
        for joint, values in enumerate(zip(self._goal, self.stepped.position, strict=True)):
            bar = picture[joint * ROW + MARGIN : (joint + 1) * ROW - MARGIN]
            bar[:] = GREY
            for value, colour in zip(values, (GREEN, BLUE), strict=True):
                share = np.clip((value - lower[joint]) / (upper[joint] - lower[joint]), 0.0, 1.0)
                column = int(share * (WIDTH - MARK))
                bar[:, column : column + MARK] = colour
        return picture

    def close(self) -> None:
        """Shut the robot down."""
        self.stepped.close()

    def _observe(self) -> Observation:
        return {
            "position": self.stepped.position,
            "velocity": self.stepped.velocity,
            "command": self._command.copy(),
            "goal": self._goal.copy(),
        }

    def _draw_goal(self) -> FloatArray:
        lower, upper = self._range()
        middle, half = (lower + upper) / 2.0, REACH * (upper - lower) / 2.0
        return np.asarray(self.np_random.uniform(middle - half, middle + half), np.float64)

    def _range(self) -> tuple[FloatArray, FloatArray]:
        """Return the position limits; ``TURN_RAD`` to both sides for joints without."""
        lower, upper = self.stepped.lower, self.stepped.upper
        unlimited = np.isinf(upper)
        return np.where(unlimited, -TURN_RAD, lower), np.where(unlimited, TURN_RAD, upper)

    def _within_limits(self, position: FloatArray) -> FloatArray:
        clipped: FloatArray = np.clip(position, self.stepped.lower, self.stepped.upper)
        return clipped
