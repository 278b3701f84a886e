"""The backend mujoco over ROS: cube on /tf, gripper, cameras, and the force at the wrist."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from PIL import Image as Pillow
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tests.plugins.mujoco.cell import CUBE_M, LEFT
from tf2_msgs.msg import TFMessage

from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_ros.client.ros_client import RosClient
from robotd_ros.host import RosHost
from robotd_ros.run_nodes import run_nodes
from robotd_scenario import FaultSchedule
from robotd_testing.domain import own_domain

TIMEOUT_S = 60.0


@pytest.fixture(scope="module")
def robot() -> Robot:
    start = {"initial_position_rad": LEFT}
    descriptor = load_robot_descriptor("cr3a")
    section = {**descriptor.backends["mujoco"], **start}
    backends = {**descriptor.backends, "mujoco": section}
    descriptor = descriptor.model_copy(update={"backends": backends})
    return Robot(descriptor, load_backend("mujoco"), PacedClock(1.0))


@pytest.fixture(scope="module")
def client(robot: Robot) -> Iterator[RosClient]:
    with (
        own_domain() as domain,
        pytest.MonkeyPatch.context() as patch,
        RosHost(domain_id=domain) as host,
        run_nodes(robot, ["manipulator_state"], host, parts={"scenario": FaultSchedule(robot, ())}),
    ):
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        robot.start()
        client = RosClient(timeout_s=TIMEOUT_S)
        client.start()
        try:
            yield client
        finally:
            client.close()
            robot.shutdown()


def first(
    client: RosClient, kind: Any, topic: str, fits: Callable[[Any], bool] = lambda message: True
) -> Any:
    """Return the next message of a topic for which ``fits`` is True."""
    found: list[Any] = []

    def take(message: Any) -> None:
        if fits(message):
            found.append(message)

    subscription = client.node.create_subscription(kind, topic, take, 10)
    client.wait(lambda: found, topic)
    client.node.destroy_subscription(subscription)
    return found[0]


def test_the_cube_is_a_transform(client: RosClient) -> None:
    message = first(client, TFMessage, "/tf")
    poses = {
        transform.child_frame_id: transform.transform.translation
        for transform in message.transforms
    }
    assert [poses["cube"].x, poses["cube"].y, poses["cube"].z] == pytest.approx(CUBE_M, abs=1e-3)


def test_the_wrist_reports_weight(client: RosClient) -> None:
    weight = pytest.approx(0.66 * 9.81, abs=0.1)
    topic = "force_torque_sensor_broadcaster/wrench"
    message = first(client, WrenchStamped, topic, lambda message: message.wrench.force.z == weight)
    assert message.header.frame_id == "link6"


def test_pictures_come_raw_and_compressed_with_their_camera(client: RosClient) -> None:
    raw = first(client, Image, "cell_camera/image_raw")
    assert (raw.width, raw.height, raw.encoding, raw.step) == (320, 240, "rgb8", 960)
    picture = np.frombuffer(raw.data, np.uint8).reshape(240, 320, 3).astype(int)
    red, green, blue = picture.transpose(2, 0, 1)
    assert ((red > 2 * green) & (red > 2 * blue)).sum() > 20  # the cube
    compressed = first(client, CompressedImage, "cell_camera/image_raw/compressed")
    opened = np.asarray(Pillow.open(io.BytesIO(bytes(compressed.data)))).astype(int)
    assert np.abs(opened - picture).mean() < 4.0
    info = first(client, CameraInfo, "cell_camera/camera_info")
    # 50° over 240 pixels.
    assert info.k[0] == pytest.approx(120 / np.tan(np.radians(25.0)))
    assert (info.k[2], info.k[5], info.header.frame_id) == (160.0, 120.0, "cell_camera")


def test_a_closed_gripper_holds_the_cube(client: RosClient, robot: Robot) -> None:
    gripper = robot.gripper
    assert gripper is not None
    state = gripper.move(0.045, lambda: False)
    assert (state.stalled, state.at_rest) == (True, True)
    assert robot.device.physics.held_object() == "cube"
