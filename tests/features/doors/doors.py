"""Every way to open a robot, with its own way to move the joints, in stepped time."""

from __future__ import annotations

import logging
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import structlog
from click.testing import CliRunner
from tests.features.harness import Observed
from tests.features.learning import lerobot_stand_in

import robotd
from robotd import Robot
from robotd.api import AxisKeys, FloatArray, ProcessImage, RobotdError
from robotd.cli import main, run_command
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.control.sources.trajectory_execution import TrajectoryExecution
from robotd.descriptor import load_robot_descriptor
from robotd.motion import TrajectoryRequest
from robotd.plugin.manager import load_backend
from robotd_commissioning import session
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.start_pose import StartPose
from robotd_gym import SteppedRobot
from robotd_recording.recording_reader import Recording, read_recording
from robotd_scenario.program import MoveStep, Scenario, ScenarioStep
from robotd_scenario.recording_comparison import CommandRepeater
from robotd_scenario.scenario_run import ScenarioRun
from robotd_testing import served_robot

LEROBOT = Path(__file__).parents[3] / "features" / "learning" / "lerobot_robot_robotd"
RATE_HZ = 50
RECORDED_HZ = 100
START = (0.0, 0.3, 1.4, -0.2, 1.2, 0.0)
GOAL_S = 1.0  # time of a goal
TICK_S = 0.04  # of a source that goes on commanding
SOURCE_S = 2.6
HELD_RAD_S = 1.5
LONGEST_PERIODS = 2000  # of a goal, at any speed

PLAIN = f"""
extends: cr3a
name: guarded
cycle: {{rate_hz: {RATE_HZ}}}
inputs: {{teach: 0.3}}
stop_input: {{input_byte: 0, input_bit: 5, motion_level: 0}}
recorder: {{enabled: false}}
backends: {{sim: {{initial_position_rad: {[*START]}}}}}
"""
GUARDED = f"""{PLAIN}tool_space:
  reduced_speed_input: teach
  reduced_speed_level: 1
  collisions:
    margin_m: 0.02
    links: false
    planes: {{floor: {{normal: [0, 0, 1]}}}}
"""

Action = Callable[[Robot], None]


class Door:
    """Robot as it has been opened, and the way in which its opener moves the joints.

    Args:
        robot: of the opener.
        go: commands all joints, and goes on to for ``SOURCE_S`` or until the motion is over.
        starts: ``go`` starts the robot.

    Attributes:
        said: error that ``go`` has raised.
        times_s, positions: of each period since ``go`` began; (6,) measured, rad.
    """

    def __init__(self, robot: Robot, go: Callable[[], None], *, starts: bool = False) -> None:
        self.robot = robot
        self._go, self._starts = go, starts
        self._actions: list[tuple[float, Action]] = []
        self._began_ns = 0
        self.said = ""
        self.times_s: list[float] = []
        self._positions: list[FloatArray] = []
        robot.control_loop.every(RATE_HZ, "trace", self._note)

    @property
    def positions(self) -> FloatArray:
        return np.array(self._positions)

    def at(self, seconds: float, action: Action) -> None:
        """Call ``action(robot)`` in the control loop, ``seconds`` after ``go`` begins."""
        self._actions.append((seconds, action))

    def go(self, arrange: Action = lambda robot: None) -> None:
        """Move after ``arrange``, as far as the robot lets it."""
        robot, start = self.robot, self.robot.start

        def begin() -> None:
            robot.step(5)  # feedback has come, and inputs are read
            arrange(robot)
            self._began_ns = robot.clock.now_ns()
            robot.step(12)

        def start_and_begin(*, enable: bool = True) -> None:
            start(enable=enable)
            begin()

        if self._starts:
            robot.start = start_and_begin  # type: ignore[method-assign]
        else:
            begin()
        try:
            self._go()
        except (AssertionError, RobotdError) as error:
            self.said = str(error)
        self.rest()

    def rest(self) -> None:
        """Let ``SOURCE_S`` pass since ``go`` began, where it has ended before."""
        passed_s = (self.robot.clock.now_ns() - self._began_ns) * 1e-9
        self.robot.step(max(0, round((SOURCE_S - passed_s) * RATE_HZ)))

    def _note(self, image: ProcessImage) -> None:
        if not self._began_ns:
            return
        passed_s = (self.robot.clock.now_ns() - self._began_ns) * 1e-9
        self.times_s.append(passed_s)
        self._positions.append(image.position[:6].copy())
        for action in [action for action in self._actions if action[0] <= passed_s]:
            self._actions.remove(action)
            action[1](self.robot)


def insist(robot: Robot, send: Callable[[], object]) -> None:
    """Send on as a client does that looks at no answer; raise its first error at the end."""
    errors: list[RobotdError] = []
    for _ in range(round(SOURCE_S / TICK_S)):
        before_ns = robot.clock.now_ns()
        try:
            send()
        except RobotdError as error:
            errors.append(error)
        if robot.clock.now_ns() == before_ns:
            robot.step(round(TICK_S * RATE_HZ))
    if errors:
        raise errors[0]


def require_success(execution: TrajectoryExecution) -> None:
    assert execution.outcome is Outcome.SUCCEEDED, execution.message


@contextmanager
def server(file: Path, target: FloatArray) -> Iterator[Door]:
    """``robotd run``, and a goal; what serves the nodes starts the robot as this does."""
    served: list[Robot] = []

    def serve(robot: Robot, *_: Any, **__: Any) -> int:
        served.append(robot)
        return 0

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_command, "_server", lambda registry: serve)
        patch.setattr(run_command, "PacedClock", lambda scale: SteppedClock())
        arguments = ("run", "--robot", str(file), "--backend", "sim", "--time-scale", "1")
        before, handlers = structlog.get_config(), [*logging.getLogger().handlers]
        result = CliRunner().invoke(main, arguments, prog_name="robotd")
        structlog.configure(**before)
        logging.getLogger().handlers[:] = handlers
    assert result.exit_code == 0, result.output
    (robot,) = served
    robot.start()
    yield Door(robot, partial(follow, robot, target))
    robot.shutdown()


@contextmanager
def testing(file: Path, target: FloatArray) -> Iterator[Door]:
    """A robot under test of ``robotd_testing``, without its nodes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(served_robot, "PacedClock", lambda scale: SteppedClock())
        patch.setattr(served_robot, "RosHost", lambda **_: nullcontext())
        patch.setattr(served_robot, "run_nodes", lambda *_, **__: nullcontext())
        with served_robot.robot_under_test(file, 0) as under_test:
            yield Door(under_test.robot, partial(follow, under_test.robot, target))


def follow(robot: Robot, target: FloatArray) -> None:
    """Execute a goal, as the action of the nodes does."""
    request = TrajectoryRequest.from_rows(robot.joint_names, [GOAL_S], [target.tolist()])
    with robot.follower.follow(request) as execution:
        for _ in range(LONGEST_PERIODS):
            if not execution.done:
                robot.step(1)
        require_success(execution)


@contextmanager
def python(file: Path, target: FloatArray) -> Iterator[Door]:
    """``open_robot``, and a stream of positions."""
    with robotd.open_robot(file, "sim", clock=SteppedClock()) as robot:

        def go() -> None:
            with robot.stream(timeout_s=1.0, owner="program") as stream:
                insist(robot, lambda: stream.send(target.tolist()))

        yield Door(robot, go)


@contextmanager
def gym(file: Path, target: FloatArray) -> Iterator[Door]:
    """Steps of an environment of gymnasium."""
    stepped = SteppedRobot(file, rate_hz=1.0 / TICK_S)
    stepped.reset()
    yield Door(stepped.robot, lambda: insist(stepped.robot, lambda: stepped.step(target)))
    stepped.close()


@contextmanager
def lerobot(file: Path, target: FloatArray) -> Iterator[Door]:
    """Actions of a program of LeRobot."""
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        lerobot_stand_in.install(patch)
        patch.syspath_prepend(str(LEROBOT))
        __import__("lerobot_robot_robotd")
        module = sys.modules["lerobot_robot_robotd.robotd_robot"]
        patch.setattr(module, "open_robot", partial(robotd.open_robot, clock=SteppedClock()))
        kind: Any = lerobot_stand_in.RobotConfig.types["robotd"]
        config = kind(calibration_dir=Path(folder), descriptor=str(file), backend="sim")
        with lerobot_stand_in.make_robot_from_config(config) as made:
            robot: Robot = made._robot
            names = [f"{name}.pos" for name in robot.joint_names]
            action = dict(zip(names, target.tolist(), strict=True)) | {"gripper.pos": 0.0}
            yield Door(robot, lambda: insist(robot, lambda: made.send_action(action)))


@contextmanager
def conform(file: Path, target: FloatArray) -> Iterator[Door]:
    """A trajectory of the conformance kit."""
    descriptor, backend = load_robot_descriptor(file), load_backend("sim")
    harness = Harness(backend, descriptor, StartPose(), uses_context_clock=True)
    harness.start()

    def go() -> None:
        displacement = target - harness.image.position_command[:6]
        require_success(harness.follow([GOAL_S], [displacement]))

    yield Door(harness.robot, go)
    harness.stop()


@contextmanager
def commission(file: Path, target: FloatArray) -> Iterator[Door]:
    """The first joint alone, while a key is held."""
    backend = load_backend("sim")
    keys = AxisKeys("axes", "scale", "polarity", "node", "identity")
    backend.info = replace(backend.info, axis_keys=keys)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "MonotonicClock", SteppedClock)
        patch.setattr(session, "DescriptorEdit", lambda *_: None)
        patch.setattr(session, "_drive_of", lambda *_: {})
        commissioning = session.Commissioning(
            lambda other: load_robot_descriptor(other or file),
            backend,
            "joint1",
            session.CommissionRecord(file),
            lambda axis: None,  # type: ignore[arg-type, return-value]
        )
        with commissioning._opened() as (bench, _), bench.axis.powered():
            robot: Robot = bench.axis._robot

            def velocity() -> float:
                displacement = float(target[0] - robot.image.position_command[0])
                return float(np.sign(displacement)) * HELD_RAD_S if abs(displacement) > 0.1 else 0.0

            def go() -> None:
                with bench.axis.held_motion() as held:
                    insist(robot, lambda: held.move(velocity()))

            yield Door(robot, go)


@contextmanager
def scenario(file: Path, target: FloatArray) -> Iterator[Door]:
    """A program of ``robotd sim run``."""
    descriptor = load_robot_descriptor(file)
    joints = dict(zip(descriptor.joint_names, target.tolist(), strict=True))
    steps = (ScenarioStep(move=MoveStep(to_rad=joints, time_s=GOAL_S)),)
    run = ScenarioRun(Scenario(schema=1, program=steps), descriptor, load_backend("sim"))

    def go() -> None:
        for step in run.steps():
            door.rest()  # the robot shuts down at the end
            assert not step.failure, step.failure

    door = Door(run._robot, go, starts=True)
    yield door


@contextmanager
def repetition(file: Path, target: FloatArray) -> Iterator[Door]:
    """A goal of a recording, by ``robotd sim run --from``."""
    descriptor, recording = load_robot_descriptor(file), standing()
    data = {"joints": descriptor.joint_names, "times_s": np.array([GOAL_S])}
    time_ns = recording.start_ns + 10**8
    goals = ((time_ns, data | {"positions": target[None]}),)
    repeater = CommandRepeater(replace(recording, goals=goals), descriptor, load_backend("sim"))

    def go() -> None:
        rejections = repeater.run().rejections
        assert not rejections, rejections

    yield Door(repeater._robot, go, starts=True)


@cache
def standing() -> Recording:
    """Some seconds of a robot at rest, without a command."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plain.yaml"
        rates = f"rate_hz: {RATE_HZ}", f"rate_hz: {RECORDED_HZ}"
        file.write_text(PLAIN.replace(*rates), encoding="utf-8")
        arm = Observed(Path(folder), robot=str(file))
        arm.step((SOURCE_S + 0.5) * RECORDED_HZ / 500)
        recording = read_recording(arm.flight.snapshot("test"))
        arm.close()
    return recording


Opened = Callable[[Path, FloatArray], AbstractContextManager[Door]]
DOORS: dict[str, tuple[str, Opened]] = {
    "server": ("core/robotd/cli/run_command.py", server),
    "open_robot": ("core/robotd/robot.py", python),
    "gym": ("features/learning/robotd_gym/stepped_robot.py", gym),
    "lerobot": (
        "features/learning/lerobot_robot_robotd/lerobot_robot_robotd/robotd_robot.py",
        lerobot,
    ),
    "conform": ("features/conformance/robotd_conformance/checks/harness.py", conform),
    "commission": ("features/commissioning/robotd_commissioning/session.py", commission),
    "scenario": ("features/scenario/robotd_scenario/scenario_run.py", scenario),
    "testing": ("features/testing/robotd_testing/served_robot.py", testing),
    "replay": ("features/scenario/robotd_scenario/recording_comparison.py", repetition),
}
"""Ways to open a robot: the module that makes it, and what opens it there."""
