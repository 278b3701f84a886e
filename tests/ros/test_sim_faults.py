"""Simulated faults, injected in three ways: effect on clients, and recovery.

The ways: a scenario file, ``robotd sim inject``, and the service. Each test begins with a robot
in order at its start. Its fault comes at a place: half of the travel of a goal that turns joint 6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from tests.ros.robot_process import Client, RobotProcess, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState
from wmx_ros2_message.srv import EcatGetNetworkState, GetIoBit, SetAxis, SetEngine

from robotd.cli import main
from robotd_scenario import FAULTS

pytestmark = pytest.mark.ros

SCALE = "4"
TIMES = ("--set", "backends.sim.stream_timeout_s=1", "--set", "engine.stale_after_s=1")  # simulated
TURN_RAD = 0.3
PLACE: dict[str, Any] = {"joint": "joint6", "above_rad": 0.5 * TURN_RAD}
JOINTS = [f"joint{number}" for number in range(1, 7)]


class Robot:
    """The served arm as a client sees it."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self._axes = client.listen(AxisState, "/wmx/axis/state")
        self._joints = client.listen(JointState, "/joint_states")

    @property
    def axes(self) -> Any:
        """The next state of the axes."""
        return self.client.next(self._axes)

    @property
    def follows(self) -> bool:
        """Every axis is where its command is."""
        state = self.axes
        return list(state.actual_pos) == pytest.approx(list(state.pos_cmd), abs=0.01)

    @property
    def fingers_m(self) -> float:
        return float(self.client.next(self._joints).position[6])

    @property
    def connection(self) -> str:
        return str(self.client.call(Trigger, "/wmx/engine/get_status").message)

    def slave_offline(self, slave: int) -> bool:
        answer = self.client.call(EcatGetNetworkState, "/wmx/ecat/get_network_state")
        return bool(answer.success and answer.slave_offline[slave])

    def input_bit(self, byte: int, bit: int) -> int:
        return int(self.client.call(GetIoBit, "/wmx/io/get_input_bit", byte=byte, bit=bit).value)

    def opens(self) -> bool:
        """The gripper obeys the command to open."""
        assert self.client.call(SetBool, "/wmx/set_gripper", data=False).success
        return self.fingers_m < 0.001

    def turn(self, joint6_rad: float) -> str:
        """Turn joint 6, with all others at 0; return the error text, "" when reached."""
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = JOINTS
        goal.path_tolerance = [JointTolerance(name=name, position=0.08) for name in JOINTS]
        point = JointTrajectoryPoint(positions=[0.0] * 5 + [joint6_rad])
        point.time_from_start.sec = 3
        goal.trajectory.points = [point]
        result = self.client.send_goal(goal).result()[1]
        return str(result.error_string) if result.error_code else ""

    def recover(self) -> None:
        """As an operator does: engine, alarms, servos."""
        if self.connection == "Idle":
            answer = self.client.call(SetEngine, "/wmx/engine/set_device", data=True)
            assert answer.success, answer.message
        self.client.call(SetBool, "/wmx/engine/set_comm", data=True)
        self.client.wait_engine()
        for name, data in (("clear_alarm", 0), ("set_on", 1)):
            answer = self.client.call(
                SetAxis, f"/wmx/axis/{name}", index=list(range(6)), data=[data] * 6
            )
            assert answer.success, answer.message


Look = Callable[[Robot], object]


@dataclass(frozen=True)
class Case:
    """Fault with the expected result of the running goal and further conditions."""

    kind: str
    keys: dict[str, Any] = field(default_factory=dict)
    says: str = ""
    sees: Look = lambda robot: True
    later: Look = lambda robot: True


CASES = [
    Case(
        "amp_alarm",
        {"axis": 2, "code": 0x3210},
        "amplifier alarm 12816 (DC link over-voltage)",
        lambda robot: list(robot.axes.amp_alarm) == [axis == 2 for axis in range(6)],
    ),
    Case("following_error", {"axis": 5, "for_s": 2.0}, "joint6", later=lambda robot: robot.follows),
    Case(
        "slave_lost",
        {"axis": 1, "for_s": 8.0},
        "joint2 at ",
        lambda robot: robot.slave_offline(1),
        lambda robot: not robot.slave_offline(1) and not robot.axes.servo_on[1],
    ),
    Case("packet_loss", {"count": 3000}, "ms old", later=lambda robot: robot.axes),
    Case("late_cycles", {"late_s": 1.2}, "(setpoints stayed away)"),
    Case(
        "stuck_gripper",
        {"closed": True, "for_s": 8.0},
        sees=lambda robot: robot.fingers_m > 0.04,
        later=Robot.opens,
    ),
    Case(
        "input_bit",
        {"byte": 1, "bit": 2, "value": True, "for_s": 8.0},
        sees=lambda robot: robot.input_bit(1, 2) == 1,
        later=lambda robot: robot.input_bit(1, 2) == 0,
    ),
    Case(
        "encoder_jump", {"axis": 0, "delta_rad": 0.5}, "joint1", later=lambda robot: robot.follows
    ),
    Case(
        "communication_drop",
        says="engine state Running",
        sees=lambda robot: robot.connection == "Running",
    ),
    Case("engine_stopped", says="engine state Idle", sees=lambda robot: robot.connection == "Idle"),
]


def by_command(client: Client, case: Case) -> None:
    values = case.keys | {f"when.{key}": value for key, value in PLACE.items()}
    words = [f"{key}={str(value).lower()}" for key, value in values.items()]
    result = CliRunner().invoke(main, ["sim", "inject", case.kind, *words])
    assert result.exit_code == 0, result.output


def by_service(client: Client, case: Case) -> None:
    where = {f"when.{key}": value for key, value in PLACE.items()}
    answer = client.inject(case.kind, **case.keys, **where)
    assert answer.success, answer.message


def by_scenario(client: Client, case: Case) -> None:
    """It is in the file: see ``scenario``."""


# Every kind by service; what a scenario and a command read is tested in simulated time, for each
# kind in tests/features/scenario and tests/core/cli.
NUMBERS = range(1, len(CASES) + 1)
SCENARIO = 1
CHOSEN = [(by_service, number) for number in NUMBERS]
CHOSEN += [(by_scenario, SCENARIO), (by_command, 1), (by_command, 3)]


@pytest.fixture(scope="module")
def way(request: pytest.FixtureRequest) -> Any:
    return request.param


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scenario file with one fault."""
    case = CASES[SCENARIO - 1]
    faults = [{"when": PLACE, case.kind: case.keys}]
    path = tmp_path_factory.mktemp("scenario") / "faults.yaml"
    path.write_text(yaml.safe_dump({"schema": 1, "faults": faults}), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def robot(way: Any, scenario: Path) -> Iterator[Robot]:
    with pytest.MonkeyPatch.context() as patch:
        options = ["--scenario", str(scenario)] if way is by_scenario else []
        with RobotProcess("--time-scale", SCALE, *TIMES, *options, backend="sim") as process:
            patch.setenv("ROS_DOMAIN_ID", str(process.domain))
            process.wait_ready()
            client = Client(process.domain)
            yield Robot(client)
            client.close()
            assert process.end() == 0, process.output


def test_every_kind_is_tested() -> None:
    """But a hand, which moves a joint that is guided: see tests/features/scenario/test_faults."""
    assert [case.kind for case in CASES] == [kind for kind in FAULTS if kind != "moved_by_hand"]


@pytest.mark.parametrize(
    ("way", "number"),
    CHOSEN,
    ids=[f"{way.__name__}-{CASES[number - 1].kind}" for way, number in CHOSEN],
    indirect=["way"],
)
def test_a_fault_is_seen_and_recovered_from(robot: Robot, way: Any, number: int) -> None:
    case = CASES[number - 1]
    robot.recover()
    assert robot.turn(0.0) == ""
    way(robot.client, case)
    said = robot.turn(TURN_RAD)
    assert case.says in said if case.says else not said, said
    wait_until(lambda: case.sees(robot), f"{case.kind} is seen")
    wait_until(lambda: case.later(robot), f"{case.kind} is over")
    robot.recover()
    assert robot.turn(TURN_RAD) == ""
