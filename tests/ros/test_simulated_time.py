"""Simulated time and faults over ROS: /clock, stamps, steps, and what is injected."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from robotd_msgs.srv import StepTime
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tests.ros.robot_process import Client, RobotProcess, wait_until
from trajectory_msgs.msg import JointTrajectoryPoint
from wmx_ros2_message.msg import AxisState

from robotd.cli.exit_codes import ExitCode
from robotd_ros.middleware.action_server import RESULT_TIMEOUT_S

pytestmark = pytest.mark.ros

PERIOD_S = 0.002
DEEP = 2000
SETTLING = 1000  # periods after which what was left of an earlier motion has died away


def seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec * 1e-9)


def step(client: Client, periods: int) -> Any:
    """Run the time for a number of periods; return the response."""
    return client.call(StepTime, "/robotd_sim/step", periods=periods)


def goal(position: float, time_s: float) -> Any:
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = [f"joint{number}" for number in range(1, 7)]
    duration = Duration(sec=int(time_s), nanosec=round(time_s % 1 * 1e9))
    message.trajectory.points = [
        JointTrajectoryPoint(positions=[position] * 6, time_from_start=duration)
    ]
    return message


def state_after_step(client: Client, states: list[Any]) -> Any:
    """The joint states of the period that one step lets pass."""
    answer = step(client, 1)
    assert answer.success, answer.message
    now_s = seconds(answer.time)

    def find() -> Any:
        return next(
            (state for state in states if abs(seconds(state.header.stamp) - now_s) < 1e-4), 0
        )

    state = wait_until(find, f"joint states of {now_s} s")
    states.clear()
    return state


@pytest.fixture(scope="module")
def fast() -> Iterator[RobotProcess]:
    with RobotProcess("--time-scale", "max") as process:
        process.wait_ready()
        yield process


@pytest.fixture
def client(fast: RobotProcess) -> Iterator[Client]:
    client = Client(fast.domain)
    client.call(SetBool, "/robotd_sim/pause", data=False)
    yield client
    client.call(SetBool, "/robotd_sim/pause", data=True)  # it would take a whole core
    client.close()


def processor_s(process: RobotProcess) -> float:
    """Processor time of a robot so far: how long it takes is the computer's affair."""
    fields = Path(f"/proc/{process.process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_a_goal_takes_a_fraction_of_its_time(fast: RobotProcess, client: Client) -> None:
    clocks = client.listen(Clock, "/clock")
    wait_until(lambda: clocks, "no clock")
    begin_s, first_s = processor_s(fast), seconds(clocks[-1].clock)
    assert client.send_goal(goal(0.5, 10.0)).result()[1].error_code == 0
    passed_s = seconds(clocks[-1].clock) - first_s
    assert passed_s >= 9.5
    assert processor_s(fast) - begin_s < 0.9 * passed_s
    assert client.send_goal(goal(0.0, 10.0)).result()[1].error_code == 0


def test_no_result_is_lost_at_full_speed(client: Client) -> None:
    """Results are asked for more than 12 simulated seconds after their goals have ended."""
    for _ in range(5):  # until the computer is fast enough: they are kept for 10 s of real time
        begin_s = time.monotonic()
        handles = [client.send_goal(goal(0.01, 1.0), ask_result=False) for _ in range(3)]
        assert client.send_goal(goal(0.5, 12.0)).result()[1].error_code == 0
        ends = []
        for handle in handles:
            handle.ask_result()
            ends.append(handle.result())
        if time.monotonic() - begin_s < RESULT_TIMEOUT_S:
            break
    known = {GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_ABORTED}
    assert {status for status, _ in ends} <= known
    assert all(result.error_string for _, result in ends)
    assert client.send_goal(goal(0.0, 10.0)).result()[1].error_code == 0


def test_feedback_has_its_rate_in_simulated_time(client: Client) -> None:
    feedback: list[Any] = []
    assert client.send_goal(goal(0.5, 10.0), feedback).result()[1].error_code == 0
    stamps = [seconds(message.header.stamp) for message in feedback]
    # Whatever a slow client loses, each message has its own tick: time was held until then.
    ticks = [(stamp - stamps[0]) / 0.04 for stamp in stamps]
    assert ticks == pytest.approx([round(tick) for tick in ticks], abs=2.5 * PERIOD_S / 0.04)
    assert len(stamps) > 20
    assert client.send_goal(goal(0.0, 10.0)).result()[1].error_code == 0


def test_time_stands_when_paused_and_steps_whole_periods(client: Client) -> None:
    clocks, states = client.listen(Clock, "/clock", DEEP), client.listen(
        JointState, "/joint_states", DEEP)  # fmt: skip
    wait_until(lambda: clocks and states, "no time")
    client.call(SetBool, "/robotd_sim/pause", data=True)
    assert step(client, 1).success
    begin = seconds(step(client, 1).time)
    clocks.clear()
    states.clear()
    answer = step(client, 50)
    assert seconds(answer.time) == pytest.approx(begin + 50 * PERIOD_S)
    for messages in (clocks, states):
        wait_until(lambda messages=messages: len(messages) >= 50, "50 messages")
    times = [seconds(message.clock) for message in clocks[-50:]]
    assert times[-1] == pytest.approx(begin + 50 * PERIOD_S)
    assert all(b - a == pytest.approx(PERIOD_S) for a, b in pairwise(times))
    assert [seconds(state.header.stamp) for state in states[-50:]] == times


def test_the_same_steps_give_the_same_joint_states(client: Client) -> None:
    """Two goals from the same place, each under way for 300 periods, bit for bit."""
    states = client.listen(JointState, "/joint_states", DEEP)

    def run() -> list[bytes]:
        client.call(SetBool, "/robotd_sim/pause", data=True)
        step(client, SETTLING)
        handle = client.send_goal(goal(0.4, 0.5))
        rows: list[bytes] = []
        moving = 0
        while moving < 300:
            state = state_after_step(client, states)
            if moving or any(state.velocity):
                moving += 1
                rows.append(state.position.tobytes() + state.velocity.tobytes())
        for goal_handle in (handle, client.send_goal(goal(0.0, 1.0))):
            wait_until(
                lambda goal_handle=goal_handle: goal_handle.done or not step(client, 50),
                "the end",
            )
            assert goal_handle.result()[1].error_code == 0
        return rows

    assert run() == run()


@pytest.mark.parametrize("periods", [0, 1_000_001])
def test_steps_that_make_no_sense_are_rejected(client: Client, periods: int) -> None:
    answer = step(client, periods)
    assert not answer.success
    assert f"periods: {periods} is outside 1..1000000" in answer.message


def test_a_fault_is_injected_and_a_wrong_one_rejected(client: Client) -> None:
    states = client.listen(AxisState, "/wmx/axis/state")
    assert "did you mean 'axis'?" in client.inject("amp_alarm", axs=1).message
    assert "axis 9 is outside 0..5" in client.inject("amp_alarm", axis=9).message
    answer = client.inject("amp_alarm", axis=1, code=77, at_s=0.5)
    assert answer.success
    assert answer.message == "amp_alarm axis=1 code=77"
    wait_until(lambda: states and states[-1].amp_alarm[1], "no alarm")
    assert robotd(client, "servo", "on").returncode == 0
    wait_until(lambda: not states[-1].amp_alarm[1], "alarm not cleared")


def robotd(client: Client, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"ROS_DOMAIN_ID": str(client.domain)}
    command = [sys.executable, "-m", "robotd", *arguments]
    return subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=90
    )


def test_the_commands_reach_the_simulation(client: Client) -> None:
    for arguments, text in (
        (["pause"], "time paused"),
        (["step", "10"], "time paused at"),
        (["inject", "packet_loss", "count=1"], "packet_loss count=1"),
        (["resume"], "time runs"),
    ):
        result = robotd(client, "sim", *arguments)
        assert result.returncode == 0, result.stderr
        assert text in result.stdout
    result = robotd(client, "sim", "inject", "amp_alarm", "axis=7")
    assert result.returncode == ExitCode.FAILED
    assert "axis 7 is outside 0..5" in result.stderr


def test_it_stops_in_order_while_time_stands() -> None:
    with RobotProcess("--time-scale", "max") as process:
        process.wait_ready()
        client = Client(process.domain)
        client.call(SetBool, "/robotd_sim/pause", data=True)
        client.close()
        assert process.end() == 0
        assert "device closed" in process.output


def test_a_scenario_happens_to_a_robot_in_real_time(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("schema: 1\nfaults:\n  - {at_s: 0.3, communication_drop: {}}\n", "utf-8")
    with RobotProcess("--scenario", str(path)) as process:
        process.wait_output("communication_drop")
        client = Client(process.domain)
        client.wait_engine(ready=False)
        assert not client.node.get_publishers_info_by_topic("/clock")
        client.close()
