"""Terminals of the tool, and the controller's own frames, on the stand-in of both generations."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from tests.plugins.dobot.stand_in_backend import StandInFaults

from robotd import open_robot
from robotd.api import InvalidArgument, OperationError, RobotdError
from robotd.api.robots import Robot

ROBOT = Path(__file__).parent / "robot.yaml"
WAIT_S = 30.0
TOOL = 2  # byte of its terminals


@pytest.fixture(scope="module", params=["v4", "v3"])
def generation(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def robot_file(folder: Path, options: str) -> Path:
    """Write a robot as that of the other tests, with a gripper on the tool and ``options``."""
    file = folder / "robot.yaml"
    file.write_text(
        f"{{schema: 1, name: tool_test, extends: {ROBOT}, gripper: {{output_byte: 2}},"
        f" backends: {{dobot_stand_in: {{tool_io: true, {options}}}}}}}"
    )
    return file


@pytest.fixture(scope="module")
def shared(
    backend: str, generation: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Robot]:
    options = f"tool_index: 3, user_index: 1, generation: {generation}"
    with open_robot(robot_file(tmp_path_factory.mktemp("robot"), options)) as robot:
        yield robot


@pytest.fixture
def robot(shared: Robot) -> Robot:
    shared.recover()
    return shared


@pytest.fixture
def faults(robot: Robot) -> StandInFaults:
    assert isinstance(robot.fault_injector, StandInFaults)
    return robot.fault_injector


def wait_until(condition: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline, f"not in time: {what}"
        time.sleep(0.01)


def test_an_input_of_the_tool_is_shown(robot: Robot, faults: StandInFaults) -> None:
    for bit in (0, 1):
        faults.set_input_bit(TOOL, bit, True)
        wait_until(partial(robot.io.input_bit, TOOL, bit), "the input is on")
        assert robot.io.input_bytes(0, 3) == bytes([0, 0, 1 << bit])
        faults.set_input_bit(TOOL, bit, False)
        wait_until(lambda: robot.io.input_bytes(0, 3) == bytes(3), "the input is off")


def test_an_output_of_the_tool_is_switched(robot: Robot, faults: StandInFaults) -> None:
    robot.io.set_output_bit(TOOL, 1, True)
    assert [faults.output_bit(TOOL, bit) for bit in (0, 1)] == [False, True]
    assert not faults.output_bit(0, 1)
    wait_until(lambda: robot.io.output_bytes(0, 3) == b"\0\0\2", "the output is shown")
    robot.io.set_output_bytes(1, b"\1\1")
    assert [faults.output_bit(TOOL, bit) for bit in (0, 1)] == [True, False]
    wait_until(lambda: robot.io.output_bytes(0, 3) == b"\0\1\1", "the outputs are shown")
    robot.io.set_output_bytes(0, bytes(3))
    wait_until(lambda: robot.io.output_bytes(0, 3) == bytes(3), "the outputs are shown")


def test_a_tool_has_two_outputs(robot: Robot, faults: StandInFaults) -> None:
    for call in (
        lambda: robot.io.set_output_bit(TOOL, 2, True),
        lambda: robot.io.set_output_bytes(1, b"\1\4"),
    ):
        with pytest.raises(InvalidArgument, match="the tool has bits 0 and 1"):
            call()
    assert not faults.output_bit(1, 0)  # nothing of a call that is rejected is written


def test_a_gripper_is_on_an_output_of_the_tool(robot: Robot, faults: StandInFaults) -> None:
    assert robot.gripper is not None
    robot.gripper.command(closed=True)
    assert faults.output_bit(TOOL, 0)
    robot.gripper.command(closed=False)
    assert not faults.output_bit(TOOL, 0)


def test_inputs_of_the_tool_are_off_in_an_alarm(robot: Robot, faults: StandInFaults) -> None:
    """The controller rejects the question then; what it said before does not count."""
    faults.set_input_bit(TOOL, 0, True)
    wait_until(lambda: robot.io.input_bit(TOOL, 0), "the input is on")
    faults.trip(0, 17)
    wait_until(lambda: not robot.io.input_bit(TOOL, 0), "the input is off")
    robot.recover()
    wait_until(lambda: robot.io.input_bit(TOOL, 0), "the input is on again")
    faults.set_input_bit(TOOL, 0, False)


def test_outputs_of_the_tool_are_shown_after_a_lost_connection(
    robot: Robot, faults: StandInFaults, generation: str
) -> None:
    """V3 has no question for them."""
    robot.io.set_output_bit(TOOL, 0, True)
    faults.drop_communication()
    wait_until(lambda: not robot.connection.ready, "the connection is lost")
    robot.recover()
    assert faults.output_bit(TOOL, 0)
    if generation == "v4":
        wait_until(lambda: robot.io.output_bit(TOOL, 0), "the output is shown")
    robot.io.set_output_bit(TOOL, 0, False)


def test_frames_are_selected_when_the_arm_is_switched_on(
    robot: Robot, faults: StandInFaults
) -> None:
    assert [faults.send("tool_frame"), faults.send("user_frame")] == [3, 1]
    robot.servos.disable()
    faults.send("select_tool", 0)  # another client
    robot.recover()
    assert faults.send("tool_frame") == 3


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ("tool_index: 12, controller: v3", "tool_index: 12: V3 has frames 0 to 9"),
        ("tool_index: 12, generation: v3", "tool_index: 12: V3 has frames 0 to 9"),  # by asking it
        ("user_index: 51", "user_index: must be at most 50"),
    ],
)
def test_a_frame_beyond_those_of_the_generation_is_rejected(
    backend: str, tmp_path: Path, options: str, problem: str
) -> None:
    with (
        pytest.raises(RobotdError, match=problem),
        open_robot(robot_file(tmp_path, options)),
    ):
        pass


def test_a_frame_that_the_controller_rejects_is_named(robot: Robot, faults: StandInFaults) -> None:
    robot.servos.disable()
    faults.send("last_frame", 2)
    try:
        with pytest.raises(OperationError, match=r"Tool: "):
            robot.axes.servo(0, True)
    finally:
        faults.send("last_frame", 9)
