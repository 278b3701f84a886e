"""Paths from recordings and LeRobot datasets, and back.

``lerobot_0_4_4`` was written by that release: two episodes of an SO-101 in degrees.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer
from pyarrow import parquet
from tests.command_line import Robotd

from robotd import DescriptorError, InvalidArgument, open_robot
from robotd.api import FloatArray, RecordingError, RobotDescriptor, load_robot_descriptor
from robotd.api.robots import SteppedClock
from robotd_teach.joint_motion_file import FileMotion
from robotd_teach.joint_state_file import read_joint_states
from robotd_teach.lerobot_dataset import ACTION, AngleUnit, read_episode
from robotd_teach.path_curve import interpolated
from robotd_teach.path_exchange import export_path, limits_of, save_motion
from robotd_teach.path_file import PathFile, folder_of, read_path, write_path
from robotd_teach.paths import Paths

LEROBOT = Path(__file__).with_name("lerobot_0_4_4")
TOLERANCE_RAD = 0.005
JOINT_STATE = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    f"float64[] effort\n{'=' * 80}\nMSG: std_msgs/Header\n"
    f"builtin_interfaces/Time stamp\nstring frame_id\n{'=' * 80}\n"
    "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
JOINTS = ["joint1", "joint2", "joint3", "joint4", "joint5", "joint6"]
ARM = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")
BEGIN_S = 1_000  # of a bag


@pytest.fixture
def arm(tmp_path: Path) -> RobotDescriptor:
    """An arm with a path ``wipe`` of 2.5 s, and its folder of paths."""
    file = tmp_path / "robot.yaml"
    file.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    descriptor = load_robot_descriptor(str(file))
    points = np.zeros((3, 6))
    points[1:, 0], points[1:, 2] = [0.4, -0.2], [0.5, 0.9]
    path = PathFile.of("arm", JOINTS, np.array([0.0, 1.0, 2.5]), points)
    write_path(folder_of(descriptor) / "wipe.yaml", path)
    return descriptor


def saved(descriptor: RobotDescriptor, name: str) -> PathFile:
    return read_path(folder_of(descriptor) / f"{name}.yaml")


def motion(positions: FloatArray, rate_hz: float = 100.0) -> FileMotion:
    return FileMotion("file", np.arange(len(positions)) / rate_hz, positions)


def write_bag(path: Path, *topics: tuple[str, list[str], FloatArray], stamp_s: int = 0) -> Path:
    """Write joint states at 100 Hz by a writer that shares no code with robotd."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
        for topic, joints, rows in topics:
            for index, row in enumerate(rows.tolist()):
                seconds, hundredths = divmod(index, 100)
                stamp = {"sec": stamp_s + seconds, "nanosec": hundredths * 10_000_000}
                message = {
                    "header": {"stamp": stamp, "frame_id": ""},
                    "name": joints,
                    "position": row,
                    "velocity": [],
                    "effort": [],
                }
                log_ns = (BEGIN_S * 100 + index) * 10_000_000
                writer.write_message(topic, schema, message, log_ns, log_ns)
        writer.finish()
    return path


def ramp(count: int = 150) -> FloatArray:
    """Joint states of an arm at rest, then turned by 0.6 rad at joint1, and at rest again."""
    rows = np.zeros((count, 6))
    rows[:, 0] = 0.6 * (0.5 - 0.5 * np.cos(np.pi * np.clip((np.arange(count) - 20) / 100, 0, 1)))
    return rows


def assert_keeps(path: PathFile, rows: FloatArray, rate_hz: float) -> None:
    """Each position of a file is on the path, which begins a little later."""
    farthest = []
    for offset_s in np.arange(0.0, 0.5, 0.005):
        times_s = np.clip(np.arange(len(rows)) / rate_hz - offset_s, 0.0, path.duration_s)
        curve = interpolated(path.times_s, path.positions(path.joints), times_s)
        farthest.append(np.abs(curve - rows).max())
    assert min(farthest) < TOLERANCE_RAD


def test_a_bag_of_another_program_becomes_a_path(arm: RobotDescriptor, tmp_path: Path) -> None:
    order = [5, 4, 3, 2, 1, 0]
    other = ("/joint_states", ["gripper"], np.zeros((150, 1)))
    states = ("/joint_states", [JOINTS[index] for index in order], ramp()[:, order])
    bag = write_bag(tmp_path / "bag.mcap", other, states, stamp_s=77)
    limits = limits_of(arm)
    told = save_motion(arm, "turn", read_joint_states(bag, "arm", limits.names), limits)
    assert told.startswith("turn: 1.")
    path = saved(arm, "turn")
    assert (path.robot, path.joints) == ("arm", JOINTS)
    assert path.duration_s == pytest.approx(0.95, abs=0.1)  # without standing at its ends
    assert_keeps(path, ramp(), 100.0)


def test_a_part_of_the_time_is_taken(arm: RobotDescriptor, tmp_path: Path) -> None:
    rows = np.vstack([ramp(), ramp()[::-1]])
    bag = write_bag(tmp_path / "bag.mcap", ("/joint_states", JOINTS, rows))
    found = read_joint_states(bag, "arm", JOINTS, begin_s=1.5)
    assert found.times_s[[0, -1]] == pytest.approx([1.5, 2.99])
    assert found.positions[[0, -1], 0] == pytest.approx([0.6, 0.0])
    assert len(read_joint_states(bag, "arm", JOINTS, begin_s=1.0, end_s=1.5).times_s) == 51


def test_topics_are_chosen_by_name(tmp_path: Path) -> None:
    two = [(topic, JOINTS, ramp()) for topic in ("/left/joint_states", "/right/joint_states")]
    bag = write_bag(tmp_path / "bag.mcap", *two)
    with pytest.raises(InvalidArgument, match=r"several topics: name one \(available: /left/joint"):
        read_joint_states(bag, "arm", JOINTS)
    assert len(read_joint_states(bag, "arm", JOINTS, "/left/joint_states").times_s) == 150
    with pytest.raises(InvalidArgument, match=r"no topic '/joint_states' of joint states"):
        read_joint_states(bag, "arm", JOINTS, "/joint_states")
    one = write_bag(tmp_path / "one.mcap", two[0])
    assert len(read_joint_states(one, "arm", JOINTS).times_s) == 150


def test_what_a_file_lacks_is_named(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag.mcap", ("/joint_states", JOINTS[:5], ramp()[:, :5]))
    with pytest.raises(InvalidArgument, match=r"has no joint joint6 \(available: joint1, joint2"):
        read_joint_states(bag, "arm", JOINTS)
    with pytest.raises(InvalidArgument, match="no positions in this part of its time"):
        read_joint_states(bag, "arm", JOINTS[:5], begin_s=99.0)
    with pytest.raises(RecordingError, match="No such file"):
        read_joint_states(tmp_path / "none.mcap", "arm", JOINTS)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(bag.read_bytes()[:-100])
    with pytest.raises(RecordingError, match=r"not a complete MCAP .*robotd record --recover"):
        read_joint_states(cut, "arm", JOINTS[:5])
    text = tmp_path / "text.mcap"
    text.write_text("hello", encoding="utf-8")
    with pytest.raises(RecordingError, match="not a recording: it does not begin as an MCAP"):
        read_joint_states(text, "arm", JOINTS)


def test_what_no_path_can_be_is_rejected_and_nothing_saved(arm: RobotDescriptor) -> None:
    limits, rows = limits_of(arm), ramp()
    gap = motion(np.delete(rows, np.s_[60:70], axis=0))
    gap.times_s[60:] += 0.6
    for found, reason in (
        (gap, r"file: the joints moved during 0\.6 s without positions, at 0\.59 s"),
        (motion(rows * 10), r"file: joint1 would be at 3\.\d+ rad, its limits are -3\.14 to 3\.14"),
        (motion(rows, 0.5), r"file: it lasts 298 s, a path at most 180 s: choose a part"),
        (motion(0.0 * rows), "nothing was recorded: the joints have not moved"),
        (motion(rows[:1]), "file: no positions in this part of its time"),
    ):
        with pytest.raises(InvalidArgument, match=reason):
            save_motion(arm, "turn", found, limits)
    with pytest.raises(InvalidArgument, match="there is a path 'wipe' already"):
        save_motion(arm, "wipe", motion(rows), limits)
    assert not (folder_of(arm) / "turn.yaml").exists()
    save_motion(arm, "wipe", motion(rows), limits, replace=True)
    assert saved(arm, "wipe").duration_s == pytest.approx(0.95, abs=0.1)
    with pytest.raises(InvalidArgument, match="name one of the joint groups left, right"):
        limits_of(load_robot_descriptor("dual_cr3a"))


def test_a_path_is_written_as_joint_states_and_read_back(
    arm: RobotDescriptor, tmp_path: Path
) -> None:
    target = tmp_path / "out" / "wipe.mcap"
    assert export_path(arm, "wipe", target).endswith("wipe, 2.5 s, 251 messages at 100 Hz")
    with target.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [message.decoded_message for message in reader.iter_decoded_messages()]
    assert list(found[0].name) == JOINTS
    stamps = [state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec for state in found]
    assert np.diff(stamps) == pytest.approx(0.01, abs=1e-6)
    rows = np.array([state.position for state in found])
    assert rows[[0, 100, 250], 0].tolist() == pytest.approx([0.0, 0.4, -0.2])
    limits = limits_of(arm)
    save_motion(arm, "again", read_joint_states(target, "arm", limits.names), limits)
    assert_keeps(saved(arm, "again"), rows, 100.0)
    with pytest.raises(InvalidArgument, match="exists already: name a new file"):
        export_path(arm, "wipe", target)
    with pytest.raises(InvalidArgument, match="unknown path 'wip'; did you mean 'wipe'"):
        export_path(arm, "wip", tmp_path / "other.mcap")


def types_of(schema: Any) -> dict[str, str]:
    """Types of columns; the name of a list's element is left to the version of pyarrow."""
    return {column.name: str(column.type).replace("item", "element") for column in schema}


def test_a_dataset_of_lerobot_becomes_a_path_in_rad(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text("extends: so101\nname: my_arm\nposes: poses.yaml\n", encoding="utf-8")
    descriptor = load_robot_descriptor(str(file))
    limits = limits_of(descriptor, "arm")
    assert limits.names == ARM
    found = read_episode(LEROBOT, 1, "my_arm", ARM, AngleUnit.DEG)
    assert np.degrees(found.positions[-1]) == pytest.approx([-30, -20, 10, 0, 5], abs=1e-4)
    assert found.times_s[-1] == pytest.approx(59 / 30)
    actions = read_episode(LEROBOT, 1, "my_arm", ARM, AngleUnit.DEG, feature=ACTION)
    assert np.degrees(actions.positions - found.positions) == pytest.approx(1.0, abs=1e-4)
    save_motion(descriptor, "wave", found, limits)
    path = saved(descriptor, "wave")
    assert path.positions(ARM)[-1] == pytest.approx(np.radians([-30, -20, 10, 0, 5]), abs=5e-3)


def test_percentages_need_the_calibration(tmp_path: Path) -> None:
    file = tmp_path / "arm.json"
    joint = {"id": 1, "drive_mode": 0, "homing_offset": 3, "range_min": 1000, "range_max": 3048}
    mirrored = joint | {"drive_mode": 1}
    content = {name: mirrored if name == ARM[1] else joint for name in ARM}
    file.write_text(json.dumps(content), encoding="utf-8")
    found = read_episode(LEROBOT, 0, "my_arm", ARM, AngleUnit.PERCENT, file)
    # 2048 ticks are half a turn: 100 % is a quarter of a turn from the middle.
    assert found.positions[-1, :2] == pytest.approx([0.3 * np.pi / 2, 0.2 * np.pi / 2], abs=1e-6)
    with pytest.raises(InvalidArgument, match="a calibration file belongs to percent"):
        read_episode(LEROBOT, 0, "my_arm", ARM, AngleUnit.PERCENT)
    with pytest.raises(InvalidArgument, match="a calibration file belongs to percent"):
        read_episode(LEROBOT, 0, "my_arm", ARM, AngleUnit.DEG, file)
    file.write_text("{}", encoding="utf-8")
    with pytest.raises(
        DescriptorError, match="is not a calibration file of LeRobot for these joints"
    ):
        read_episode(LEROBOT, 0, "my_arm", ARM, AngleUnit.PERCENT, file)


def test_what_a_dataset_lacks_is_named(tmp_path: Path) -> None:
    deg = AngleUnit.DEG
    with pytest.raises(InvalidArgument, match="unit the positions of so101_follower have: name"):
        read_episode(LEROBOT, 0, "my_arm", ARM)
    with pytest.raises(InvalidArgument, match=r"no joint elbow \(available: shoulder_pan, "):
        read_episode(LEROBOT, 0, "my_arm", ["elbow"], deg)
    with pytest.raises(InvalidArgument, match=r"no episode 2 \(available: 0 to 1\)"):
        read_episode(LEROBOT, 2, "my_arm", ARM, deg)
    with pytest.raises(InvalidArgument, match=r"no feature 'state' \(available: action, obs"):
        read_episode(LEROBOT, 0, "my_arm", ARM, deg, feature="state")
    with pytest.raises(RecordingError, match=r"not a LeRobot dataset: .*info"):
        read_episode(tmp_path, 0, "my_arm", ARM)
    copy = tmp_path / "copy"
    shutil.copytree(LEROBOT, copy)
    data = copy / "data/chunk-000/file-000.parquet"
    data.write_bytes(data.read_bytes()[:500])
    with pytest.raises(RecordingError, match="not a file of a dataset"):
        read_episode(copy, 0, "my_arm", ARM, deg)
    info = copy / "meta/info.json"
    info.write_text(info.read_text(encoding="utf-8").replace("v3.0", "v2.1"), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"of version v2\.1, must be v3\.0: LeRobot converts"):
        read_episode(copy, 0, "my_arm", ARM, deg)


def test_a_path_is_written_as_lerobot_writes_a_dataset(
    arm: RobotDescriptor, tmp_path: Path
) -> None:
    target = tmp_path / "wipe"
    assert export_path(arm, "wipe", target).endswith("wipe, 2.5 s, 76 frames at 30 Hz")
    for name in ("data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"):
        ours, theirs = (parquet.read_schema(folder / name) for folder in (target, LEROBOT))
        assert types_of(ours) == types_of(theirs)
    for name, key in (("info", "features"), ("stats", "action")):
        ours, theirs = (
            json.loads((folder / "meta" / f"{name}.json").read_text(encoding="utf-8"))
            for folder in (target, LEROBOT)
        )
        assert ours.keys() == theirs.keys()
        assert ours[key].keys() == theirs[key].keys()
    tasks = parquet.read_table(target / "meta/tasks.parquet")
    assert tasks.to_pylist() == [{"task_index": 0, "task": "wipe"}]
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    found = read_episode(target, 0, "arm", JOINTS)
    assert found.positions[[0, 30, 75], 0].tolist() == pytest.approx([0.0, 0.4, -0.2])
    save_motion(arm, "again", found, limits_of(arm))
    assert_keeps(saved(arm, "again"), found.positions, 30.0)
    with pytest.raises(InvalidArgument, match="exists already"):
        export_path(arm, "wipe", target)


def test_the_commands_need_no_running_robot(
    arm: RobotDescriptor, tmp_path: Path, robotd: Robotd
) -> None:
    robot = ("--robot", str(arm.path))
    for target, again in (("wipe.mcap", "of_states"), ("wipe", "of_frames")):
        file = str(tmp_path / target)
        assert robotd("path", "export", "wipe", file, *robot).exit_code == 0
        result = robotd("path", "import", file, "--name", again, *robot)
        assert f"{again}: 2." in result.output
    for words, reason in (
        ((str(LEROBOT), "--topic", "/a"), "--topic belongs to an MCAP file"),
        ((f"{LEROBOT}#last",), "episode 'last' of"),
        ((str(tmp_path / "wipe.mcap"), "--unit", "deg"), "belong to a dataset"),
    ):
        result = robotd("path", "import", *words, "--name", "other", *robot)
        assert result.exit_code == 2
        assert reason in result.output
    assert arm.path is not None
    with open_robot(arm.path, "sim", clock=SteppedClock()) as running:
        paths = running.feature(Paths)
        assert not any(state.problem for state in paths.all().values())
        paths.play("of_states", approach=True)
        assert running.image.position[0] == pytest.approx(-0.2, abs=TOLERANCE_RAD)
