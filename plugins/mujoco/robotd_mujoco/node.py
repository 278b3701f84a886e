"""Node of the backend mujoco: cameras, force at the wrist, and true pose of a base."""

from __future__ import annotations

import array
import threading
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from robotd.api import (
    NANOSECONDS,
    ProcessImage,
    RobotdError,
    World,
    WorldCamera,
    due_cameras,
    get_logger,
    jpeg,
)
from robotd_mujoco.physics import Physics
from robotd_ros.api import HotPublisher, Robot, RosHost, StampClock

NAME = "mujoco"
WRENCH = "force_torque_sensor_broadcaster/wrench"
WRENCH_RATE_HZ = 100.0
GROUND_TRUTH = "base_pose_ground_truth"
GROUND_TRUTH_RATE_HZ = 50.0
SCENE_FRAME = "world"
THREAD_END_S = 2.0

log = get_logger("mujoco")


class MujocoNode(Node):
    """Node of the backend; served with every robot on it."""

    def __init__(self, robot: Robot, host: RosHost) -> None:
        super().__init__(NAME, context=host.context)
        physics: Physics = robot.device.physics
        self.rates_hz: dict[str, float] = {}
        self._robot, self._physics = robot, physics
        self._stamps = StampClock(self.get_clock())
        self._wrenches = [
            HotPublisher(self, topic, 10, WrenchStamped(header=_header(link)), ["wrench"])
            for topic, link in wrench_topics(physics)
        ]
        self._views = [wrench.view("wrench") for wrench in self._wrenches]
        if self._wrenches:
            rate_hz = min(WRENCH_RATE_HZ, robot.descriptor.cycle.rate_hz)
            robot.control_loop.every(rate_hz, "wrench", self._publish_wrench)
            self.rates_hz |= {wrench.topic: rate_hz for wrench in self._wrenches}
        if physics.robot_model.is_free:
            self._add_ground_truth()
        cameras = physics.robot_model.cameras
        self._cameras = {camera.name: CameraTopics(self, camera) for camera in cameras}
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._render, args=(robot.world,), name="robotd-cameras", daemon=True
        )
        if self._cameras:
            self._thread.start()

    def destroy_node(self) -> None:
        """End the thread of the cameras, too."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(THREAD_END_S)
        super().destroy_node()

    def _add_ground_truth(self) -> None:
        """Publish where a base is, in the scene, which its odometry does not know."""
        root = self._physics.robot_model.root
        template = Odometry(header=_header(SCENE_FRAME), child_frame_id=root)
        paths = ["pose.pose", "twist.twist"]
        self._truth = HotPublisher(self, GROUND_TRUTH, 10, template, paths)
        self._pose, self._twist = (self._truth.view(path) for path in paths)
        rate_hz = min(GROUND_TRUTH_RATE_HZ, self._robot.descriptor.cycle.rate_hz)
        self._robot.control_loop.every(rate_hz, "ground truth", self._publish_ground_truth)
        self.rates_hz[self._truth.topic] = rate_hz

    def _publish_ground_truth(self, image: ProcessImage) -> None:
        """Control loop."""
        if not self._robot.connection.ready or not self._truth.has_readers:
            return
        with self._physics.lock:
            self._pose[:], self._twist[:] = self._physics.root_pose(), self._physics.root_twist()
        self._truth.stamp(self._stamps.at_ns(self._robot.control_loop.started_ns))
        self._truth.publish()

    def _publish_wrench(self, image: ProcessImage) -> None:
        """Control loop."""
        if not self._robot.connection.ready:
            return
        stamp_ns = self._stamps.at_ns(self._robot.control_loop.started_ns)
        wrenches = self._physics.wrenches()
        for message, view, wrench in zip(self._wrenches, self._views, wrenches, strict=True):
            if message.has_readers:
                view[:] = wrench
                message.stamp(stamp_ns)
                message.publish()

    def _render(self, world: World) -> None:
        """Thread of the cameras: a picture of each at its rate, while there are subscribers."""
        cameras = world.cameras
        try:
            # The first picture opens OpenGL, which holds the interpreter for 0.2 s: now, before
            # anything moves, and not with the first subscriber or viewer.
            world.image(cameras[0].name)
            for now_ns, camera in due_cameras(cameras, self._stop, self._robot.clock):
                topics = self._cameras[camera.name]
                if topics.have_subscribers:
                    topics.publish(world.image(camera.name), self._stamps.at_ns(now_ns))
        except RobotdError as error:
            log.error("no pictures of the cameras", reason=str(error))
        except Exception:
            log.exception("the cameras ended")


class CameraTopics:
    """Topics of one camera, with the names of image_transport. Thread of the cameras.

    Args:
        camera: described by the scene.
    """

    def __init__(self, node: Node, camera: WorldCamera) -> None:
        self.camera = camera
        self._raw = node.create_publisher(Image, f"{camera.name}/image_raw", 1)
        compressed = f"{camera.name}/image_raw/compressed"
        self._compressed = node.create_publisher(CompressedImage, compressed, 1)
        self._info = node.create_publisher(CameraInfo, f"{camera.name}/camera_info", 1)

    @property
    def have_subscribers(self) -> bool:
        """A picture is wanted."""
        topics = (self._raw, self._compressed, self._info)
        return any(topic.get_subscription_count() for topic in topics)

    def publish(self, picture: NDArray[np.uint8], stamp_ns: int) -> None:
        """Publish what has subscribers."""
        camera = self.camera
        header = _header(camera.name)
        header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, NANOSECONDS)
        if self._info.get_subscription_count():
            self._info.publish(camera_info(camera, header))
        if self._raw.get_subscription_count():
            message = Image(header=header, height=camera.height, width=camera.width)
            message.encoding, message.step = "rgb8", 3 * camera.width
            message.data = array.array("B", picture.tobytes())
            self._raw.publish(message)
        if self._compressed.get_subscription_count():
            message = CompressedImage(header=header, format="rgb8; jpeg compressed bgr8")
            message.data = array.array("B", jpeg(picture))
            self._compressed.publish(message)


def camera_info(camera: WorldCamera, header: Any) -> CameraInfo:
    """Return the pinhole model of a camera without distortion."""
    focal, middle_x, middle_y = camera.focal_px, camera.width / 2, camera.height / 2
    message = CameraInfo(header=header, height=camera.height, width=camera.width)
    message.distortion_model, message.d = "plumb_bob", [0.0] * 5
    message.k = [focal, 0.0, middle_x, 0.0, focal, middle_y, 0.0, 0.0, 1.0]
    message.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    message.p = [focal, 0.0, middle_x, 0.0, 0.0, focal, middle_y, 0.0, 0.0, 0.0, 1.0, 0.0]
    return message


def wrench_topics(physics: Physics) -> list[tuple[str, str]]:
    """Return topic and link of each wrist; with several, the link begins the topic."""
    links = physics.robot_model.wrists
    single = len(links) == 1
    return [(WRENCH if single else f"{link}/{WRENCH}", link) for link in links]


def _header(frame: str) -> Any:
    from std_msgs.msg import Header

    return Header(frame_id=frame)
