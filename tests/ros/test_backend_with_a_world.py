"""A backend with a world: its own node, measured fingers, objects that are placed and put back."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from robotd_msgs.msg import WorldObjects
from robotd_msgs.srv import PlaceObject
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tests.world_backend import START, CubeDevice, cube_backend
from tf2_msgs.msg import TFMessage

from robotd.clock import MonotonicClock
from robotd.descriptor import load_robot_descriptor
from robotd.errors import OperationError, PluginError
from robotd.plugin.registry import NodeRegistry
from robotd.robot import Robot
from robotd_ros.client.ros_client import RosClient
from robotd_ros.host import RosHost
from robotd_ros.run_nodes import run_nodes, served_nodes
from robotd_testing.domain import own_domain

TIMEOUT_S = 20.0
NAN = float("nan")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(load_robot_descriptor("cr3a"), cube_backend(), MonotonicClock())


@pytest.fixture(scope="module")
def client(robot: Robot) -> Iterator[RosClient]:
    with (
        own_domain() as domain,
        pytest.MonkeyPatch.context() as patch,
        RosHost(domain_id=domain) as host,
        run_nodes(robot, ["manipulator_state"], host),
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


def first(client: RosClient, kind: type, topic: str, qos: QoSProfile | int = 10) -> object:
    """Return the next message of a topic."""
    found: list[object] = []
    subscription = client.node.create_subscription(kind, topic, found.append, qos)
    client.wait(lambda: found, topic)
    client.node.destroy_subscription(subscription)
    return found[0]


def test_a_node_of_the_backend_is_served_and_reaches_its_device(client: RosClient) -> None:
    assert client.call(Trigger, "cubes/where").message == "x=0.4"


def test_measured_fingers_are_reported_by_name(client: RosClient) -> None:
    message = first(client, JointState, "joint_states")
    assert isinstance(message, JointState)
    positions = dict(zip(message.name, message.position, strict=True))
    assert (positions["picker_1_joint"], positions["picker_2_joint"]) == (0.02, 0.01)


def test_objects_are_transforms_with_shapes(client: RosClient) -> None:
    message = first(client, TFMessage, "/tf", 100)
    assert isinstance(message, TFMessage)
    (cube,) = message.transforms
    assert (cube.header.frame_id, cube.child_frame_id) == ("base_link", "cube")
    assert cube.transform.translation.x == START[0]
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    around = first(client, WorldObjects, "robotd_world/objects", latched)
    assert isinstance(around, WorldObjects)
    assert around.frame_id == "base_link"
    assert [(item.name, item.shape, [*item.size_m]) for item in around.objects] == [
        ("cube", "box", [0.04, 0.04, 0.04])
    ]


def test_an_object_is_placed_and_put_back(client: RosClient, robot: Robot) -> None:
    device: CubeDevice = robot.device
    turned = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    for fields, text, pose in (
        ({"position": [0.3, NAN, NAN]}, "x=0.3 y=0 z=0.02", [0.3, 0.0, 0.02, *START[3:]]),
        ({"rpy": [0.0, 0.0, np.pi / 2]}, "x=0.3 y=0 z=0.02", [0.3, 0.0, 0.02, *turned]),
        ({"position": [0.4, 0.1, 0.5]}, "x=0.4 y=0.1 z=0.5", [0.4, 0.1, 0.5, *turned]),
        ({}, "x=0.4 y=0.1 z=0.5", [0.4, 0.1, 0.5, *turned]),
    ):
        placed = client.call(PlaceObject, "robotd_world/place", **{"name": "cube", **fields})
        assert placed.message == f"cube is at {text}"
        assert device.cube == pytest.approx(pose)
    assert client.call(Trigger, "robotd_world/reset").success
    assert device.cube.tolist() == [*START]


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"name": "ball"}, "'ball' is unknown .available: cube"),
        ({"name": "cube", "position": [1.0]}, "position: has 1 numbers; 3 are needed, or none"),
        ({"name": "cube", "position": [NAN, NAN, -1.0]}, "z is -1, below the floor"),
        ({"name": "cube", "position": [1e9, NAN, NAN]}, "position: 1e.09 is outside -100..100"),
        ({"name": "cube", "rpy": [0.0, NAN, np.inf]}, "rpy: inf is outside -100..100"),
        ({"name": "cube", "rpy": [0.0, NAN, 0.0]}, "rpy: .* needs all three angles"),
    ],
)
def test_a_wrong_place_is_rejected(
    fields: dict[str, object], reason: str, client: RosClient, robot: Robot
) -> None:
    with pytest.raises(OperationError, match=reason):
        client.call(PlaceObject, "robotd_world/place", **fields)
    assert robot.device.cube.tolist() == [*START]


def test_a_node_with_the_name_of_another_one_is_rejected(robot: Robot) -> None:
    known = NodeRegistry()
    known.add("cubes", "elsewhere:Cubes")
    with pytest.raises(PluginError, match="is taken by"):
        served_nodes(robot, known)
