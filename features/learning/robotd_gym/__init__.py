"""Gymnasium environments of robots in simulated time.

``gymnasium.make("robotd_gym:robotd/JointReach-v0", robot="cr3a")``: the part before the colon is
the module to import, which registers the environment.
"""

from __future__ import annotations

import gymnasium

from robotd_gym.joint_reach import JointReach
from robotd_gym.pick_and_place import PickAndPlace
from robotd_gym.stepped_robot import SteppedRobot

__all__ = ["JOINT_REACH", "PICK_AND_PLACE", "JointReach", "PickAndPlace", "SteppedRobot"]

JOINT_REACH = "robotd/JointReach-v0"
PICK_AND_PLACE = "robotd/PickAndPlace-v0"
MAX_STEPS, MAX_CARRY_STEPS = 250, 500  # 10 s and 20 s at the default rate

gymnasium.register(JOINT_REACH, "robotd_gym.joint_reach:JointReach", max_episode_steps=MAX_STEPS)
gymnasium.register(
    PICK_AND_PLACE, "robotd_gym.pick_and_place:PickAndPlace", max_episode_steps=MAX_CARRY_STEPS
)
