"""A cube is picked and placed by friction alone; what cannot be held is not."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plugins.mujoco.cell import CARRIED_M, CUBE_M, LEFT, LEFT_ABOVE, RIGHT_ABOVE, cell

from robotd.errors import InvalidArgument


def test_a_cube_is_carried_to_the_other_side() -> None:
    with cell() as arm:
        assert arm.pose("cube")[:3] == pytest.approx(CUBE_M, abs=1e-3)
        arm.carry()
        assert arm.pose("cube")[:3] == pytest.approx(CARRIED_M, abs=8e-3)
        assert arm.pose("green_cube")[:2] == pytest.approx([0.5, -0.05], abs=1e-3)
        assert arm.robot.image.position == pytest.approx(RIGHT_ABOVE, abs=2e-3)


def test_the_fingers_stop_at_the_cube_and_feel_it() -> None:
    with cell() as arm:
        arm.go(LEFT_ABOVE, 2.0)
        arm.go(LEFT, 1.0)
        gripper = arm.robot.gripper
        assert gripper is not None
        state = gripper.move(0.045, lambda: False)
        assert (state.reached, state.stalled, state.at_rest) == (False, True, True)
        # The faces of the fingers are 45 mm from the middle when open, those of the cube 20 mm.
        assert gripper.finger_positions == pytest.approx([0.025, 0.025], abs=4e-3)
        assert arm.physics.held_object() == "cube"
        arm.go(LEFT_ABOVE, 1.0)
        assert arm.pose("cube")[2] == pytest.approx(0.22, abs=5e-3)


def test_a_cube_that_is_too_heavy_for_the_grip_stays() -> None:
    with cell("gripper_force_n=1.0", "finger_friction=0.1") as arm:
        arm.carry()
        assert arm.pose("cube")[1] > 0.05


def test_the_same_commands_lead_to_the_same_motion() -> None:
    states = []
    for _ in range(2):
        with cell("torque_noise_nm=0.1", "seed=3") as arm:
            arm.go(LEFT, 2.0)
            arm.grip(closed=True)
            arm.go(LEFT_ABOVE, 1.0)
            states.append((arm.physics.data.qpos.tobytes(), arm.robot.image.memory.tobytes()))
    assert states[0] == states[1]


def test_objects_are_placed_and_put_back() -> None:
    with cell() as arm:
        world = arm.robot.world
        assert world is not None
        assert world.frame == "base_link"
        pose = np.array([0.3, -0.2, 0.3, 0.0, 0.0, 0.0, 1.0])
        world.place("cube", pose)
        assert arm.pose("cube") == pytest.approx(pose)
        arm.robot.step(500)
        assert arm.pose("cube")[:3] == pytest.approx([0.3, -0.2, 0.12], abs=2e-3)
        world.reset()
        assert arm.pose("cube")[:3] == pytest.approx(CUBE_M, abs=1e-6)


def test_the_wrist_feels_the_weight_of_the_cube() -> None:
    with cell() as arm:
        arm.go(LEFT_ABOVE, 2.0)
        arm.robot.step(250)
        (empty,) = arm.physics.wrenches()
        arm.go(LEFT, 1.0)
        arm.grip(closed=True)
        arm.go(LEFT_ABOVE, 1.0)
        arm.robot.step(250)
        (loaded,) = arm.physics.wrenches()
        # The link's z points down: link and fingers weigh 0.66 kg, the cube 0.1 kg.
        assert empty[:3] == pytest.approx([0.0, 0.0, 0.66 * 9.81], abs=0.05)
        assert (loaded - empty)[:3] == pytest.approx([0.0, 0.0, 0.1 * 9.81], abs=0.05)


def test_the_cameras_see_the_cubes() -> None:
    with cell() as arm:
        world = arm.robot.world
        assert world is not None
        for camera in world.cameras:
            picture = world.image(camera.name).astype(int)
            assert picture.shape == (camera.height, camera.width, 3)
        red, green, blue = world.image("cell_camera").astype(int).transpose(2, 0, 1)
        seen = [(red > 2 * green) & (red > 2 * blue), (green > 2 * red) & (green > blue + 40)]
        assert [picture.sum() > 20 for picture in seen] == [True, True]
        world.place("cube", np.array([0.4, 0.0, -5.0, 0.0, 0.0, 0.0, 1.0]))
        red, green, blue = world.image("cell_camera").astype(int).transpose(2, 0, 1)
        assert ((red > 2 * green) & (red > 2 * blue)).sum() < 5
        with pytest.raises(InvalidArgument, match="'none' is unknown"):
            world.image("none")
