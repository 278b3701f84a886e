"""Pictures of cameras in a continuous recording, read back with mcap."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from PIL import Image

from robotd.clock import NANOSECONDS, MonotonicClock, wait_until
from robotd.clock.simulated import PacedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.feature_host import FeatureHost
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_recorder.recorder import open_recorder
from robotd_recording.recording_reader import read_recording

CAMERAS = ["cell_camera", "wrist_camera"]
SECONDS, RATE_HZ = 1.0, 10.0
WAIT_S = 60.0


def recorded(folder: Path, *overrides: str) -> tuple[Path, Any]:
    """Record an arm in simulated time; return the file and the last picture of each camera."""
    values = [parse_override(text) for text in (f"record={folder}", *overrides)]
    descriptor = load_robot_descriptor("cr3a", overrides=values)
    robot = Robot(descriptor, load_backend("mujoco"), PacedClock(1.0))
    host = FeatureHost(robot, (), "/", print)
    with open_recorder(host) as recorder:
        assert recorder is not None
        assert robot.world is not None
        with recorder.tap:
            robot.start()
            robot.clock.sleep_until_ns(robot.clock.now_ns() + round(SECONDS * NANOSECONDS))
            pictures = {name: robot.world.image(name) for name in CAMERAS}
            assert wait_until(
                lambda: recorder.continuous.report.path is not None, WAIT_S, MonotonicClock()
            )
            report = recorder.continuous.stop()
        robot.shutdown()
    assert report.path is not None
    return report.path, pictures


def images(path: Path) -> dict[str, list[Any]]:
    """Return the decoded CompressedImages of a file, by camera."""
    found: dict[str, list[Any]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for schema, channel, _, message in reader.iter_decoded_messages():
            if channel.topic.endswith("/image_raw/compressed"):
                assert schema is not None
                assert schema.name == "sensor_msgs/msg/CompressedImage"
                found.setdefault(channel.topic.split("/")[1], []).append(message)
    return found


def test_pictures_are_recorded_at_their_rate_and_are_those_of_the_cameras(tmp_path: Path) -> None:
    path, pictures = recorded(tmp_path, "recorder.cameras=true")
    found = images(path)
    assert sorted(found) == CAMERAS
    for name in CAMERAS:
        messages = found[name]
        stamps = [
            message.header.stamp.sec + message.header.stamp.nanosec * 1e-9 for message in messages
        ]
        assert len(messages) >= SECONDS * RATE_HZ
        assert np.diff(stamps) == pytest.approx(1.0 / RATE_HZ, abs=0.005)
        last = messages[-1]
        assert (last.header.frame_id, last.format) == (name, "jpeg")
        # The arm is at rest, so that any picture is like the one that the camera has now.
        shown = np.asarray(Image.open(io.BytesIO(bytes(last.data)))).astype(int)
        assert np.abs(shown - pictures[name]).mean() < 4.0
    assert len(read_recording(path).frames) > 0


def test_without_the_option_there_are_no_pictures(tmp_path: Path) -> None:
    path, _ = recorded(tmp_path)
    assert images(path) == {}
