"""Patched messages must be, byte for byte of meaning, what an ordinary publisher would send."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from structlog.testing import capture_logs
from tests.ros.robot_process import wait_until
from tf2_msgs.msg import TFMessage
from wmx_ros2_message.msg import AxisState

from robotd_ros.middleware.cdr import (
    HotPublisher,
    LayoutError,
    Link,
    PatchedMessage,
    PlainMessage,
    offset_of,
)
from robotd_ros.middleware.message_fields import MessageField

pytestmark = [pytest.mark.daily, pytest.mark.ros]

TIME_NS = 1_700_000_000_123_456_789


def joint_state(count: int = 8, frame_id: str = "base_link") -> JointState:
    message = JointState(name=[f"joint{i}" for i in range(count)])
    message.header.frame_id = frame_id
    message.position = message.velocity = message.effort = [0.0] * count
    return message


def read_back(message: PatchedMessage, message_type: type) -> Any:
    return deserialize_message(message.payload(), message_type)


@given(
    values=st.lists(st.floats(allow_nan=False), max_size=9),
    names=st.text(alphabet="abcdefghij_", min_size=1, max_size=9),
    frame_id=st.text(alphabet="abc", max_size=9),
)
@settings(max_examples=50, deadline=None)
def test_float_views_are_what_a_subscriber_reads(
    values: list[float], names: str, frame_id: str
) -> None:
    template = joint_state(len(values), frame_id)
    template.name = [names * (i + 1) for i in range(len(values))]
    message = PatchedMessage(template, ["position", "effort"])

    message.view("position")[:] = values
    message.view("effort")[:] = np.negative(values)
    message.stamp(TIME_NS)

    read = read_back(message, JointState)
    assert list(read.position) == values
    assert list(read.effort) == [-value for value in values]
    assert list(read.velocity) == [0.0] * len(values)
    assert read.name == template.name
    assert read.header.frame_id == frame_id
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == divmod(TIME_NS, 10**9)


@given(st.lists(st.booleans(), min_size=1, max_size=8))
@settings(max_examples=30, deadline=None)
def test_bool_arrays_of_one_length_are_told_apart(servo_on: list[bool]) -> None:
    arrays = [name for name in AxisState.get_fields_and_field_types() if name != "header"]
    template = AxisState()
    for name in arrays:
        is_bool = "bool" in AxisState.get_fields_and_field_types()[name]
        setattr(template, name, [False if is_bool else 0.0] * len(servo_on))
    message = PatchedMessage(template, arrays)

    message.view("servo_on")[:] = servo_on
    message.view("home_done")[:] = np.logical_not(servo_on)
    message.view("actual_torque")[:] = math.nan

    read = read_back(message, AxisState)
    assert list(read.servo_on) == servo_on
    assert list(read.home_done) == [not on for on in servo_on]
    assert not any(read.amp_alarm)
    assert all(math.isnan(torque) for torque in read.actual_torque)
    assert list(read.pos_cmd) == [0.0] * len(servo_on)


def test_nested_messages_and_fixed_arrays() -> None:
    template = Odometry(child_frame_id="base_footprint")
    template.header.frame_id = "odom"
    message = PatchedMessage(
        template,
        ["pose.pose.position", "pose.pose.orientation.w", "pose.covariance", "twist.twist"],
    )

    message.view("pose.pose.position")[:] = 1.0, 2.0, 3.0
    message.view("pose.pose.orientation.w")[0] = 0.5
    message.view("pose.covariance")[:] = np.arange(36)
    message.view("twist.twist")[5] = 0.25

    read = read_back(message, Odometry)
    assert (read.pose.pose.position.x, read.pose.pose.position.z) == (1.0, 3.0)
    assert read.pose.pose.orientation.w == 0.5
    assert read.pose.covariance.tolist() == list(range(36))
    assert read.twist.twist.angular.z == 0.25
    assert read.child_frame_id == "base_footprint"


def test_every_stamp_of_an_array_of_messages_is_set() -> None:
    transforms = [TransformStamped(child_frame_id=name) for name in ("a", "bcd")]
    message = PatchedMessage(TFMessage(transforms=transforms), ["transforms.1.transform"])

    message.stamp(TIME_NS)
    message.view("transforms.1.transform")[:] = range(7)

    read = read_back(message, TFMessage)
    assert [t.header.stamp.nanosec for t in read.transforms] == [123_456_789] * 2
    assert read.transforms[1].transform.translation.z == 2.0
    assert read.transforms[1].transform.rotation.w == 6.0
    assert read.transforms[0].transform.translation.z == 0.0


def test_float_views_are_aligned_and_template_values_are_kept() -> None:
    template = joint_state(6)
    template.effort = [math.nan] * 6
    template.position = [0.5] * 6
    before = repr(template)

    message = PatchedMessage(template, ["position", "effort"])

    assert repr(template) == before
    assert repr(read_back(message, JointState)) == before
    assert message.view("position").flags.aligned
    assert message.view("position").flags.writeable


@pytest.mark.parametrize(
    "path", ["torque", "position.0", "name", "name.0", "header.stamp", "header.nothing.x"]
)
@pytest.mark.parametrize("kind", [PatchedMessage, PlainMessage])
def test_wrong_path_is_rejected_with_the_path_in_the_text(kind: Any, path: str) -> None:
    with pytest.raises(ValueError, match=path.replace(".", r"\.")) as caught:
        kind(joint_state(), [path])
    assert not isinstance(caught.value, LayoutError)


def big_endian(message: Any) -> bytes:
    """Stands for an encoding that is not the machine's."""
    return serialize_message(message)[::-1]


def test_another_encoding_is_a_layout_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robotd_ros.middleware.cdr.serialize_message", big_endian)
    with pytest.raises(LayoutError, match="JointState: the middleware encodes it in another way"):
        PatchedMessage(joint_state(), ["position"])


def test_numbers_that_do_not_lie_side_by_side_are_a_layout_error() -> None:
    field = MessageField(PoseStamped(), "pose.position")
    near = {"pose.position.x": 8, "pose.position.y": 16, "pose.position.z": 24}
    assert offset_of(field, near) == 8
    with pytest.raises(LayoutError, match=r"pose\.position: its numbers do not lie side by side"):
        offset_of(field, {**near, "pose.position.z": 32})


def test_patched_and_plain_message_say_the_same() -> None:
    patched = PatchedMessage(joint_state(), ["position"])
    plain = PlainMessage(joint_state(), ["position"])
    for message in (patched, plain):
        message.view("position")[:] = np.linspace(-1.0, 1.0, 8)
        message.stamp(TIME_NS)
    assert read_back(patched, JointState) == plain.payload()


@pytest.mark.parametrize("kind", [PatchedMessage, PlainMessage])
def test_a_link_copies_numbers_to_the_beginning_of_a_field(kind: Any) -> None:
    message = kind(joint_state(8), ["position"])
    source = np.zeros((2, 6))
    link = Link(message.view("position"), source[1])
    source[1] = range(1, 7)
    link()
    assert list(message.view("position")) == [1, 2, 3, 4, 5, 6, 0, 0]


def test_a_link_refuses_what_is_not_contiguous() -> None:
    message = PatchedMessage(joint_state(8), ["position"])
    with pytest.raises(TypeError, match="contiguous"):
        Link(message.view("position"), np.zeros((6, 2))[:, 0])


@pytest.fixture
def context(monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    context = Context()
    rclpy.init(args=[], context=context)
    yield context
    context.try_shutdown()


@pytest.fixture
def node(context: Context) -> Iterator[Node]:
    node = rclpy.create_node("test_cdr", context=context)
    yield node
    node.destroy_node()


def receive(node: Node, message_type: type, publisher: HotPublisher) -> Any:
    """Publish until a subscriber of the same process has the message."""
    received: list[Any] = []
    node.create_subscription(message_type, "topic", received.append, 10)
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    for _ in range(100):
        publisher.publish()
        executor.spin_once(timeout_sec=0.1)
        if received:
            break
    executor.shutdown()
    return received[0]


def test_subscriber_gets_the_patched_message(node: Node) -> None:
    publisher = HotPublisher(node, "topic", 10, joint_state(), ["position"])
    publisher.view("position")[:] = range(8)
    publisher.stamp(TIME_NS)
    message = receive(node, JointState, publisher)
    assert list(message.position) == list(range(8))
    assert message.header.stamp.nanosec == 123_456_789


def test_publisher_falls_back_to_ordinary_messages(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robotd_ros.middleware.cdr.serialize_message", big_endian)
    with capture_logs() as logs:
        publisher = HotPublisher(node, "topic", 10, joint_state(), ["position"])
    publisher.view("position")[:] = range(8)
    publisher.stamp(TIME_NS)
    message = receive(node, JointState, publisher)
    assert list(message.position) == list(range(8))
    assert message.header.stamp.nanosec == 123_456_789
    assert ["in another way" in log["reason"] for log in logs] == [True]


def test_a_subscriber_is_noticed_and_its_end_too(node: Node) -> None:
    publisher = HotPublisher(node, "topic", 10, joint_state(), ["position"])
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def noticed(readers: bool) -> bool:
        executor.spin_once(timeout_sec=0.01)
        return publisher.has_readers is readers

    assert publisher.has_readers is False
    subscription = node.create_subscription(JointState, "topic", print, 10)
    wait_until(lambda: noticed(True), "a reader")
    node.destroy_subscription(subscription)
    wait_until(lambda: noticed(False), "no reader")
    executor.shutdown()


def test_publishing_outlives_publisher_and_context(node: Node, context: Context) -> None:
    publishers = [HotPublisher(node, t, 10, joint_state(), ["position"]) for t in ("gone", "left")]
    node.destroy_publisher(
        next(publisher for publisher in node.publishers if publisher.topic == "gone")
    )
    context.shutdown()
    with capture_logs() as logs:
        for publisher in publishers * 3:
            publisher.publish()
    assert sorted(log["topic"] for log in logs) == ["/gone", "/left"]
