"""Each guard acts through each way to open a robot, as its measured motion shows."""

from __future__ import annotations

import ast
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.features.doors.doors import DOORS, GUARDED, PLAIN, START, Door

from robotd import Robot
from robotd.api import FloatArray, RobotdError, load_robot_descriptor
from robotd.clock.simulated import SteppedClock
from robotd.feature import installed_features
from robotd.robot import build_robot
from robotd_tool_space import Kinematics, reduced_speed
from robotd_tool_space.collision.collisions import Collisions
from robotd_tool_space.settings import ToolSpaceKeys

ROOT = Path(__file__).parents[3]
ACROSS = np.add(START, [1.5, 0.0, 0.0, 0.0, 0.0, 0.0])
INTO_FLOOR = np.add(START, [0.0, 1.1, 0.0, 0.0, 0.0, 0.0])
BEYOND = np.add(START, [3.3, 0.0, 0.0, 0.0, 0.0, 0.0])
UPPER_RAD = 3.14  # of joint1
REST_RAD = 1e-3
ARRIVED_RAD = 1.35  # travel of a motion that was not stopped
STOP, TEACH = (0, 5), (0, 3)  # bytes and bits of the inputs


@dataclass(frozen=True)
class Guard:
    """A guard of a robot, and what shows that it acts.

    Attributes:
        check: moves the robot through a door, and judges the motion; its second argument returns
            what has been said: errors of the opener, and reasons in the log.
        target: of the motion, (6,) rad.
        key: of the robot's file, where a feature has the guard.
        tasks: of the control loop, where the core has it.
    """

    check: Callable[[Door, Callable[[], str]], None]
    target: FloatArray
    key: str = ""
    tasks: tuple[str, ...] = ()


def travel(door: Door, since_s: float = 0.0, until_s: float = np.inf) -> float:
    """Return the longest travel of a joint between two times, rad."""
    times = np.array(door.times_s)
    positions = door.positions[(times >= since_s) & (times <= until_s)]
    assert len(positions) > 10, "the robot was observed"
    return float(np.ptp(positions, axis=0).max())


def speed(door: Door) -> float:
    """Return the highest measured speed of the link of the tool, m/s."""
    kinematics = Kinematics.of_descriptor(load_robot_descriptor("cr3a"), "joints")
    places = kinematics.forward(door.positions)[:, :3, 3]
    seconds = np.diff(door.times_s)
    return float((np.linalg.norm(np.diff(places, axis=0), axis=1) / seconds).max())


def moves_without_a_guard(door: Door, said: Callable[[], str]) -> None:
    """Move that those with a guard are compared with."""
    door.go()
    assert door.said == ""
    assert travel(door) > ARRIVED_RAD
    assert speed(door) > 0.5


def collision(door: Door, said: Callable[[], str]) -> None:
    settings = door.robot.descriptor.settings(ToolSpaceKeys).tool_space.collisions
    assert settings is not None
    kinematics = Kinematics.of_descriptor(door.robot.descriptor, "joints")
    collisions = Collisions.of(door.robot.descriptor, kinematics, settings)
    assert collisions.distances(INTO_FLOOR[None]).min() < -0.1
    door.go()
    assert collisions.distances(door.positions).min() > settings.margin_m - 1e-3
    assert "and floor would" in said()


def teach(robot: Robot) -> None:
    robot.fault_injector.set_input_bit(*TEACH, True)


def reduced_speed_by_input(door: Door, said: Callable[[], str]) -> None:
    door.go(teach)
    assert 0.15 < speed(door) < 0.27


def reduced_speed_by_command(door: Door, said: Callable[[], str]) -> None:
    door.go(lambda robot: robot.feature(reduced_speed).set(True))
    assert 0.15 < speed(door) < 0.27


def stop_input(door: Door, said: Callable[[], str]) -> None:
    door.at(0.6, lambda robot: robot.fault_injector.set_input_bit(*STOP, True))
    door.at(1.5, lambda robot: robot.fault_injector.set_input_bit(*STOP, False))
    door.go()
    assert 0.05 < travel(door) < ARRIVED_RAD
    assert travel(door, 1.2) < REST_RAD
    assert "stop input 0.5" in said()


def stop_and_rearming(door: Door, said: Callable[[], str]) -> None:
    """After the reset nothing moves on, also where the command goes on."""
    latch = door.robot.axes.stop_latch
    door.at(0.6, lambda robot: latch.engage("of the test"))
    door.at(1.5, lambda robot: latch.release(latch.stops))
    door.go()
    assert latch.reason == ""
    assert 0.05 < travel(door) < ARRIVED_RAD
    assert travel(door, 1.2) < REST_RAD
    assert "of the test" in said()


def soft_limits(door: Door, said: Callable[[], str]) -> None:
    door.go()
    assert door.positions[:, 0].max() < UPPER_RAD + REST_RAD
    assert travel(door) > 3.0 or "position 3.3 rad exceeds 3.14 rad" in said()


def reduced_percentage(door: Door, said: Callable[[], str]) -> None:
    door.go(lambda robot: robot.set_speed(0.1))
    assert travel(door, 0.0, 2.0) > 0.05
    assert speed(door) < 0.2


def pause(door: Door, said: Callable[[], str]) -> None:
    door.at(0.6, lambda robot: robot.pause())
    door.at(1.9, lambda robot: robot.resume())
    door.go()
    assert 0.05 < travel(door, 0.0, 1.8) < ARRIVED_RAD
    assert travel(door, 1.2, 1.8) < REST_RAD


def ownership(door: Door, said: Callable[[], str]) -> None:
    """One of two clients has the joints; the other one is rejected with its name."""
    others = []

    def claim(robot: Robot) -> None:
        with suppress(RobotdError):
            others.append(robot.groups.only.stream(owner="another", timeout_s=100.0))

    door.go(claim)
    if others:
        assert "another" in said()
        assert travel(door) < REST_RAD
    else:
        assert travel(door) > ARRIVED_RAD


GUARDS = {
    "none": Guard(moves_without_a_guard, ACROSS),
    "collision": Guard(collision, INTO_FLOOR, key="tool_space.collisions"),
    "reduced speed by input": Guard(
        reduced_speed_by_input, ACROSS, key="tool_space.reduced_speed_input"
    ),
    "reduced speed by command": Guard(reduced_speed_by_command, ACROSS),
    "stop input": Guard(stop_input, ACROSS, tasks=("stop", "standstill")),
    "stop and re-arming": Guard(stop_and_rearming, ACROSS, tasks=("silence", "interruptions")),
    "soft limits": Guard(soft_limits, BEYOND, tasks=("travel",)),
    "speed": Guard(reduced_percentage, ACROSS),
    "pause": Guard(pause, ACROSS),
    "ownership": Guard(ownership, ACROSS),
}
ALL_JOINTS = "needs the positions of all joints; the command does not begin, see test_guards.py"
NOT_POSSIBLE = {
    ("collision", "commission"): ALL_JOINTS,
    ("reduced speed by input", "commission"): ALL_JOINTS,
    ("reduced speed by command", "commission"): ALL_JOINTS,
    ("speed", "gym"): "streams take the speed when they are opened, which reset() does",
    ("speed", "lerobot"): "streams take the speed when they are opened, which connect() does",
}
"""Cells without a test, and the reason of each."""
NO_GUARDS = {
    "gripper": "moves the fingers of a command to their end",
    "power": "keeps what each drive reports",
}
NO_DOORS = {
    "core/robotd/cli/check_command.py": "makes the robot, and starts nothing",
    "features/teleop/robotd_teleop/teleop_command.py": "opens both robots by open_robot",
    "features/learning/lerobot_robot_robotd/lerobot_robot_robotd/robotd_teleoperator.py": (
        "opens a leader arm by open_robot, and leaves its servos off"
    ),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, Path]:
    """The robot's file, with the guards of features and without."""
    folder = tmp_path_factory.mktemp("robots")
    found = {}
    for has_guards, text in ((True, GUARDED), (False, PLAIN)):
        found[has_guards] = folder / f"robot_{has_guards}.yaml"
        found[has_guards].write_text(text, encoding="utf-8")
    return found


CELLS = [(guard, door) for guard in GUARDS for door in DOORS if (guard, door) not in NOT_POSSIBLE]


@pytest.mark.parametrize(("guard", "door"), CELLS)
def test_a_guard_acts_through_a_door(guard: str, door: str, files: dict[bool, Path]) -> None:
    chosen, (_, opened) = GUARDS[guard], DOORS[door]
    file = files[door != "commission"]
    with capture_logs() as lines, opened(file, chosen.target) as through:

        def said() -> str:
            reasons = [str(line["reason"]) for line in lines if "reason" in line]
            return "\n".join([through.said, *reasons] if through.said else reasons)

        chosen.check(through, said)


def makes_a_robot(path: Path) -> bool:
    text = path.read_text(encoding="utf-8")
    if "Robot(" not in text and "_robot(" not in text:
        return False
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    names = {call.func.id for call in calls if isinstance(call.func, ast.Name)}
    return bool(names & {"Robot", "build_robot", "open_robot"})


def test_each_way_to_open_a_robot_is_a_door() -> None:
    """Modules that make a robot to start it, beside this table and the tools of this repository."""
    found = {
        str(path.relative_to(ROOT))
        for folder in ("core", "ros", "features", "plugins")
        for path in (ROOT / folder).rglob("*.py")
        if "tests" not in path.parts and makes_a_robot(path)
    }
    assert found == {module for module, _ in DOORS.values()} | NO_DOORS.keys()


def test_each_guard_has_a_row() -> None:
    keys = {key for feature in installed_features().values() for key in feature.guards}
    assert keys == {guard.key for guard in GUARDS.values() if guard.key}
    robot = build_robot("cr3a", "sim", clock=SteppedClock())
    tasks = robot.control_loop._tasks
    names = {task.name for task in (*tasks._first, *tasks._others)}
    assert names == {name for guard in GUARDS.values() for name in guard.tasks} | NO_GUARDS.keys()


def test_cells_that_are_not_possible_have_rows_and_columns() -> None:
    assert {guard for guard, _ in NOT_POSSIBLE} <= GUARDS.keys()
    assert {door for _, door in NOT_POSSIBLE} <= DOORS.keys()
