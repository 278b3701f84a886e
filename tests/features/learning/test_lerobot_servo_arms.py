"""LeRobot's follower and leader on two simulated buses of Feetech servos, in real time."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import yaml
from tests.features.learning import lerobot_stand_in as stand_in
from tests.plugins.serial_servo.sts_bus import StsBus
from tests.plugins.serial_servo.sts_servo import Servo

from robotd import InvalidArgument, NotReady
from robotd.api import MonotonicClock, wait_until

DISTRIBUTION = Path(__file__).parents[3] / "features" / "learning" / "lerobot_robot_robotd"
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
KEYS = [f"{joint}.pos" for joint in JOINTS]
WAIT_S, ACTION_S = 60.0, 0.02

pytestmark = pytest.mark.long

Arms = tuple[StsBus, StsBus]


@pytest.fixture
def buses() -> Iterator[Arms]:
    """Of the leader and of the follower, six servos each."""
    with ExitStack() as opened:
        made = []
        for _ in range(2):
            servos = {number: Servo() for number in range(1, 7)}
            for servo in servos.values():
                servo.set("return_delay", 0)
            made.append(opened.enter_context(StsBus(servos, seed=1)))
        yield made[0], made[1]


def write_robot(folder: Path, extends: str, port: str) -> str:
    """SO-101 whose servos are mounted with their middle at 0 rad."""
    axes = [{"axis": axis, "servo": axis + 1, "zero_tick": 2048} for axis in range(6)]
    section = {"port": port, "axes": axes, "reply_timeout_s": 0.2, "lost_after_s": 1.0}
    robot = {
        "schema": 1,
        "name": extends,
        "extends": extends,
        "engine": {"stale_after_s": 5.0, "servo_timeout_s": 30.0, "shutdown_s": 30.0},
        "backends": {"feetech": section},
    }
    path = folder / extends / "robot.yaml"
    path.parent.mkdir()
    path.write_text(yaml.safe_dump(robot), encoding="utf-8")
    return str(path)


@pytest.fixture
def devices(
    buses: Arms, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[tuple[Any, Any]]:
    """Leader and follower as LeRobot makes them from their types; not connected."""
    stand_in.install(monkeypatch)
    monkeypatch.syspath_prepend(str(DISTRIBUTION))
    __import__("lerobot_robot_robotd")
    leader = sys.modules["lerobot_robot_robotd.robotd_teleoperator"]
    monkeypatch.setattr(leader, "STALE_S", 5.0)  # outlasts the stalls of a busy computer
    made = []
    for registry, robot, bus in (
        (stand_in.TeleoperatorConfig, "so101_leader", buses[0]),
        (stand_in.RobotConfig, "so101", buses[1]),
    ):
        make_config: Callable[..., Any] = registry.types["robotd"]
        config = make_config(
            descriptor=write_robot(tmp_path, robot, bus.port),
            backend="feetech",
            calibration_dir=tmp_path,
        )
        made.append(stand_in.make_robot_from_config(config))
    yield made[0], made[1]
    for device in made:
        if device.is_connected:
            device.disconnect()


def until(condition: Callable[[], bool], what: str) -> None:
    assert wait_until(condition, WAIT_S, MonotonicClock()), what


def test_a_leader_that_is_moved_by_hand_moves_the_follower(
    buses: Arms, devices: tuple[Any, Any]
) -> None:
    leader, follower = devices
    assert leader.action_features == follower.action_features == dict.fromkeys(KEYS, float)
    recorded = []
    pose = {1: 0.4, 2: -0.3, 6: 0.9}
    with leader, follower:
        buses[0].arm.move(pose)

        def follows() -> bool:
            action = leader.get_action()
            sent = follower.send_action(action)
            recorded.append(
                follower.get_observation() | {f"action {key}": sent[key] for key in KEYS}
            )
            time.sleep(ACTION_S)
            shafts = buses[1].arm.angles
            return all(abs(shafts[number] - angle) < 0.02 for number, angle in pose.items())

        until(follows, "the follower is where the leader is")
        expected = pytest.approx([pose.get(number, 0.0) for number in range(1, 7)], abs=0.03)
        until(
            lambda: [follower.get_observation()[key] for key in KEYS] == expected,
            "the observation is the pose",
        )
    assert all(set(frame) >= set(KEYS) for frame in recorded)
    with buses[0].lock, buses[1].lock:
        assert not any(servo.get("torque") for bus in buses for servo in bus.servos.values())
        assert not any(step.torque for servo in buses[0].servos.values() for step in servo.executed)


def test_a_leader_that_does_not_answer_gives_no_action(
    buses: Arms, devices: tuple[Any, Any]
) -> None:
    leader, _ = devices
    with pytest.raises(stand_in.DeviceNotConnectedError):
        leader.get_action()
    with leader:
        until(lambda: bool(leader.get_action()), "the pose is known")
        for servo in buses[0].servos.values():
            servo.faults.lose_request = 1.0

        def is_silent() -> bool:
            try:
                leader.get_action()
            except NotReady as error:
                return "does not answer" in str(error) or "is not known" in str(error)
            return False

        until(is_silent, "an old pose is not an action")


def test_sigterm_interrupts_until_both_are_disconnected(devices: tuple[Any, Any]) -> None:
    leader, follower = devices
    leader.connect()
    follower.connect()
    leader.disconnect()  # as LeRobot does it: the leader first
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    follower.disconnect()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_leader_without_joints_is_rejected(devices: tuple[Any, Any], tmp_path: Path) -> None:
    make_config: Callable[..., Any] = stand_in.TeleoperatorConfig.types["robotd"]
    config = make_config(descriptor="mecanum_base", calibration_dir=tmp_path)
    with pytest.raises(InvalidArgument, match="mecanum_base has no joints"):
        stand_in.make_robot_from_config(config)
