"""Programs of steps: their file, their check, and their execution on a stepped clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robotd import DescriptorError, NotReady, OperationError, Robot, open_robot
from robotd.api import Payload
from robotd.api.features import EventKind
from robotd.api.robots import SteppedClock, TrajectoryRequest
from robotd_shared.pose_file import write_poses
from robotd_teach.poses import Poses
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs
from robotd_tool_space import ToolGroups

EXAMPLES = Path(__file__).parents[3] / "examples" / "programs"
READY = {"joint1": 0.0, "joint2": 0.3, "joint3": 1.4, "joint4": -0.2, "joint5": 1.2, "joint6": 0.0}
POSES = f"speed: 1.0\nposes:\n  ready: {READY}\n".replace("'", "")
MOVE = "  - move: {pose: ready}\n"
FILE = """
extends: cr3a
name: arm
poses: poses.yaml
inputs: {part: 0.3}
outputs: {lamp: 0.1}
tool_space:
  tools: {tip: {xyz_m: [0, 0, 0.1]}}
  collisions: {planes: {floor: {normal: [0, 0, 1], distance_m: 0.2}}}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.yaml"
    path.write_text(FILE, encoding="utf-8")
    return path


@pytest.fixture
def robot(file: Path) -> Iterator[Robot]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def programs(robot: Robot) -> Programs:
    return robot.feature(Programs)


def program(steps: str, head: str = POSES) -> Program:
    return Program.parse(f"{head}steps:\n{steps}", "cell.yaml")


def positions(robot: Robot) -> list[float]:
    found: list[float] = robot.image.position[:6].tolist()
    return found


def height(robot: Robot) -> float:
    pose = robot.feature(ToolGroups).only.measured_pose()
    assert pose is not None
    return float(pose[2, 3])


def once(robot: Robot, condition: Callable[[], bool], action: Callable[[], object]) -> None:
    """Call ``action`` in the first period in which ``condition`` is true."""
    done: list[bool] = []

    def look(image: object) -> None:
        if not done and condition():
            done.append(True)
            action()

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "test", look)


def told(robot: Robot) -> list[str]:
    events = robot.events.since(0)[0]
    return [event.text for event in events if event.subject == "program"]


@pytest.mark.parametrize("name", ["pick_and_place", "inspect"])
def test_the_examples_run_on_the_arm_as_it_comes(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with open_robot("cr3a", "sim", clock=SteppedClock()) as robot:
        programs = robot.feature(Programs)
        example = Program.read(EXAMPLES / f"{name}.yaml")
        programs.run(example)
        state = programs.state
    assert (state.state, state.step) == ("done", example.steps)
    assert state.executed == {"pick_and_place": 26, "inspect": 7}[name]


def test_a_payload_is_set_at_its_step(robot: Robot, programs: Programs) -> None:
    programs.run(program(MOVE + "  - payload: {mass_kg: 0.8, center_m: [0, 0, 0.06]}\n" + MOVE))
    assert robot.payload.current() == Payload(0.8, (0.0, 0.0, 0.06))
    with pytest.raises(DescriptorError, match=r"payload: 120 kg, must be 0 or more and 100 kg"):
        programs.check(program("  - payload: {mass_kg: 120}\n"))


def test_steps_are_executed_in_their_order_and_noted(robot: Robot, programs: Programs) -> None:
    blocks = "blocks:\n  wink:\n    - output: {name: lamp, on: true}\n"
    programs.run(
        program(
            MOVE
            + "  - repeat: {times: 3, steps: [{call: wink}, {line: {by: {z: 0.01}}}]}\n"
            + "  - if: {input: part, steps: [{message: there}], else: [{message: missing}]}\n"
            + "  - gripper: close\n  - tool: tip\n  - wait: {time_s: 0.5}\n",
            POSES + blocks,
        )
    )
    state = programs.state
    assert (state.state, state.executed, state.steps) == ("done", 11, 8)
    assert state.message == "missing"
    assert robot.io.output("lamp")
    assert robot.gripper is not None
    assert robot.gripper.closed == 1.0
    tool = robot.feature(ToolGroups).only
    assert tool.tool_name == "tip"
    tool.select_tool("")
    steps = [text.partition(" step ")[2].partition(" of ")[0] for text in told(robot)]
    assert [int(step) for step in steps if step] == [1, 2, 3, 2, 3, 2, 3, 5, 6, 7, 8]
    noted = [event for event in robot.events.since(0)[0] if event.subject == "program"]
    assert {event.kind for event in noted} == {EventKind.STATE}
    assert noted[2].data["line"] == 6
    assert noted[2].data["key"] == "blocks.wink.0.output"


def test_a_gripper_that_is_a_joint_opens_closes_and_goes_between(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with open_robot("so101", "sim", clock=SteppedClock()) as robot:
        programs, gripper = robot.feature(Programs), robot.grippers["gripper"]
        for to, there in (
            ("open", gripper.open_m),
            ("close", gripper.closed_m),
            ("{name: gripper, to: 0.5}", 0.5),
        ):
            programs.run(program(f"  - gripper: {to}\n", "group: arm\n"))
            assert gripper.position_m == pytest.approx(there, abs=0.02)
        wrong = {
            "{name: left, to: open}": "unknown gripper 'left'",
            "{to: 9.0}": "gripper: position 9.0 is outside",
        }
        for to, why in wrong.items():
            with pytest.raises(DescriptorError, match=why):
                programs.check(program(f"  - gripper: {to}\n", "group: arm\n"))
        with pytest.raises(DescriptorError, match="the joints that the program moves: use `move`"):
            programs.check(program("  - gripper: open\n", "group: gripper\n"))


def test_a_repeated_way_adds_up(robot: Robot, programs: Programs) -> None:
    programs.run(program(MOVE))
    before = height(robot)
    programs.run(program("  - repeat: {times: 5, steps: [{line: {by: {z: 0.01}}}]}\n"))
    assert height(robot) == pytest.approx(before + 0.05, abs=1e-4)


def test_a_path_that_ends_at_a_limit_is_no_way_beyond_it() -> None:
    """The end of a line is computed, and is beyond the limit by a rounding."""
    with open_robot("scara", "sim", clock=SteppedClock()) as scara:
        programs = scara.feature(Programs)
        steps = "  - move: {joints: {joint1: 0.3, joint2: 0.8, joint3: 0.05}}\n"
        for z in (0.03, -0.07, 0.09):
            steps += f"  - line: {{by: {{x: 0.01, z: {z}}}}}\n"
        programs.run(program(steps, "speed: 1.0\n"))
        assert positions(scara)[2] == pytest.approx(0.0, abs=1e-6)
        with pytest.raises(DescriptorError, match=r"joint3 would .*at -\S+ m, its limit"):
            programs.check(program("  - line: {by: {x: -0.01, z: 0.001}}\n", ""))
        with pytest.raises(DescriptorError, match=r"joint3 would be at -1e-05 m, its limits are"):
            programs.check(program("  - move: {joints: {joint3: -0.00001}}\n", ""))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("steps: []\n", r"cell\.yaml:1: steps: must have 1 or more items"),
        ("steps:\n  - mve: {}\n", r"cell\.yaml:2: steps\.0\.mve: unknown key; did you mean 'move'"),
        ("steps:\n  - {}\n", r"cell\.yaml:2: steps\.0: needs exactly one of move, line"),
        (
            "steps:\n  - line: {pose: a, by: {z: 1}}\n",
            r"cell\.yaml:2: steps\.0\.line: needs exactly one of pose, joints, at, by",
        ),
        ("steps:\n  - line: {by: {z: .1}, speed: 2}\n", r"line\.speed: must be at most 1"),
        (
            "steps:\n  - sequence: {segments: [{line: {by: {z: .1}, until: {torque: 5}}}]}\n",
            r"segments\.0\.line\.until: belongs to a step of its own",
        ),
        ("steps:\n  - call: pick\n", r"cell\.yaml:2: steps\.0\.call: there is no block 'pick'"),
        (
            "blocks:\n  a: [{call: b}]\n  b: [{call: a}]\nsteps: [{gripper: open}]\n",
            r"cell\.yaml:3: blocks\.b\.0\.call: a block calls itself: a → b → a",
        ),
        (
            "blocks:\n  a: [{call: b}, {call: b}]\n"
            + "".join(f"  {x}: [{{call: {y}}}, {{call: {y}}}]\n" for x, y in zip(
                "bcdefghijklmn", "cdefghijklmno", strict=True))
            + "  o: []\nsteps: [{call: a}]\n",
            "more than 5000 steps, with those of the blocks that are called",
        ),
        ("steps:\n  - wait: {time_s: 1, is: true}\n", r"steps\.0\.wait\.is: belongs to `input`"),
    ],
)  # fmt: skip
def test_a_file_that_is_wrong_names_line_and_key(text: str, reason: str) -> None:
    with pytest.raises(DescriptorError, match=reason):
        Program.parse(text, "cell.yaml")


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ("  - move: {pose: redy}\n", r"steps\.0\.move: unknown pose 'redy'; did you mean 'ready'"),
        ("  - move: {joints: {joint2: 4}}\n", r"joint2 would be at 4 rad, its limits are -3\.14"),
        ("  - move: {joints: {elbow: 4}}\n", r"unknown joint 'elbow'"),
        (MOVE + "  - line: {by: {z: 0.6}}\n", r"cell\.yaml:6: steps\.1\.line: at \d+ % joint3"),
        (MOVE + "  - move: {at: {z: 2}}\n", r"steps\.1\.move: out of reach"),
        (MOVE + "  - line: {by: {z: -0.3}}\n", r"line: at \d+ % \w+ and floor would .* 10 mm"),
        ("  - move: {joints: {joint2: 2.0}}\n", r"move: at \d+ % \w+ and \w+ would"),
        (MOVE + "  - arc: {via: {by: {z: 0.1}}, to: {by: {z: 0.2}}}\n", "on a straight line"),
        (
            MOVE + "  - sequence: {segments: [{line: {by: {z: 0.02}}}, {line: {by: {z: 0.6}}}]}\n",
            r"cell\.yaml:6: steps\.1\.sequence: segment 2, line: at \d+ % ",
        ),
        (
            MOVE + "  - sequence: {segments: [{move: {joints: {joint1: 0.1}}}]}\n",
            r"steps\.1\.sequence: joints in a sequence: not all joints",
        ),
        ("  - output: {name: lmap, on: true}\n", r"output\.name: unknown output 'lmap'; did you"),
        (
            MOVE + "  - sequence:\n      segments:\n      - line: {by: {z: 0.02}}\n"
            "        outputs: [{name: lmap, on: true}]\n",
            r"segments\.0\.outputs\.0\.name: unknown output 'lmap'; did you",
        ),
        ("  - output: {name: 9999.1, on: true}\n", r"9999\.1 is outside the image of outputs"),
        ("  - wait: {input: door}\n", r"wait\.input: unknown input 'door'"),
        ("  - if: {input: door, steps: []}\n", r"if\.input: unknown input 'door'"),
        ("  - tool: tipp\n", r"steps\.0\.tool: unknown tool 'tipp' .* did you mean 'tip'"),
        ("  - work_frame: table\n", r"steps\.0\.work_frame: unknown work frame 'table'"),
        (
            MOVE + "  - repeat: {times: 60, steps: [{line: {by: {z: -0.01}}}]}\n",
            r"cell\.yaml:6: steps\.1\.repeat\.steps\.0\.line: at \d+ % \w+ and floor",
        ),
        (
            MOVE + "  - if: {input: part, steps: [{line: {by: {z: 0.15}}}]}\n"
            "  - line: {by: {z: -0.15}}\n",
            r"cell\.yaml:7: steps\.2\.line: at \d+ % \w+ and floor",
        ),
    ],
)
def test_the_whole_program_is_checked_before_anything_moves(
    robot: Robot, programs: Programs, steps: str, reason: str
) -> None:
    with pytest.raises(DescriptorError, match=reason):
        programs.run(program(steps))
    assert positions(robot) == pytest.approx([0.0] * 6, abs=1e-6)
    assert programs.state.state == "none"


def test_each_mistake_is_named(programs: Programs) -> None:
    with pytest.raises(DescriptorError) as caught:
        programs.check(program("  - tool: a\n  - wait: {input: door}\n  - move: {pose: ready}\n"))
    assert len(str(caught.value).splitlines()) == 2


def test_taught_poses_are_known_and_the_programs_own_come_first(
    robot: Robot, programs: Programs
) -> None:
    write_poses(robot.feature(Poses).path, {"ready": dict.fromkeys(READY, 0.1), "low": READY})
    programs.run(program(MOVE))
    assert positions(robot) == pytest.approx(list(READY.values()), abs=2e-3)
    programs.run(program("  - move: {pose: ready}\n", "speed: 1.0\n"))
    assert positions(robot) == pytest.approx([0.1] * 6, abs=2e-3)
    write_poses(robot.feature(Poses).path, {})  # the check that has passed does not count any more
    with pytest.raises(DescriptorError, match="unknown pose 'ready'"):
        programs.run(program("  - move: {pose: ready}\n", "speed: 1.0\n"))


def test_a_stopped_line_is_continued_on_its_path(robot: Robot, programs: Programs) -> None:
    programs.run(program(MOVE))
    start = height(robot)
    rows: list[np.ndarray] = []
    robot.control_loop.every(
        500.0, "rows", lambda image: rows.append(np.array(robot.image.position[:6]))
    )
    once(robot, lambda: height(robot) > start + 0.03, lambda: programs.stop("by the test"))
    steps = "  - line: {by: {z: 0.1}}\n  - message: there\n"
    with pytest.raises(
        OperationError, match=r"cell\.yaml:5: steps\.0\.line: stopped at step 1 of 2: by the test"
    ):
        programs.run(program(steps))
    assert programs.state.state == "stopped"
    assert 0.0 < programs.state.progress < 1.0
    stopped = height(robot)
    assert start + 0.03 < stopped < start + 0.08
    robot.step(500)
    assert height(robot) == pytest.approx(stopped, abs=1e-5)
    programs.resume()
    assert (programs.state.state, programs.state.executed) == ("done", 2)
    assert height(robot) == pytest.approx(start + 0.1, abs=1e-4)
    tool = robot.feature(ToolGroups).only
    places = tool.kinematics.forward(np.array(rows))[:, :3, 3]
    assert np.ptp(places[:, :2], axis=0).max() < 1e-3


def test_a_stopped_path_is_continued_around_its_corners(robot: Robot, programs: Programs) -> None:
    programs.run(program(MOVE))
    path = "  - path: {blend_m: 0.02, through: [{by: {z: 0.1}}, {by: {y: 0.1}}, {by: {z: -0.1}}]}\n"
    tool = robot.feature(ToolGroups).only

    def record() -> list[np.ndarray]:
        rows: list[np.ndarray] = []
        robot.control_loop.every(
            500.0, "rows", lambda image: rows.append(np.array(robot.image.position_command[:6]))
        )
        return rows

    rows = record()
    programs.run(program(path))
    whole = tool.kinematics.forward(np.array(rows))[:, :3, 3]
    programs.run(program(MOVE))
    rows = record()
    once(robot, lambda: programs.state.progress > 0.45, lambda: programs.stop("by the test"))
    with pytest.raises(OperationError, match="by the test"):
        programs.run(program(path))
    once(robot, lambda: programs.state.progress > 0.7, lambda: programs.stop("again"))
    with pytest.raises(OperationError, match="again"):
        programs.resume()
    programs.resume()
    parts = tool.kinematics.forward(np.array(rows))[:, :3, 3]
    away = [np.linalg.norm(whole - place, axis=1).min() for place in parts[::20]]
    assert max(away) < 2e-3
    assert parts[-1] == pytest.approx(whole[-1], abs=1e-4)


def test_after_a_stop_of_all_motion_nothing_moves_until_it_is_resumed(
    robot: Robot, programs: Programs
) -> None:
    latch = robot.axes.stop_latch
    once(robot, lambda: positions(robot)[2] > 0.5, lambda: latch.engage("by the test"))
    with pytest.raises(OperationError, match=r"stopped at step 1 of 2: .*by the test"):
        programs.run(program(MOVE + "  - message: there\n"))
    with pytest.raises(NotReady, match="by the test"):
        programs.resume()
    robot.reset()
    before = positions(robot)
    robot.step(1000)
    assert positions(robot) == pytest.approx(before, abs=1e-6)
    programs.resume()
    assert positions(robot) == pytest.approx(list(READY.values()), abs=2e-3)


def test_a_stop_in_a_wait_ends_the_program(robot: Robot, programs: Programs) -> None:
    once(robot, lambda: programs.state.step == 2, lambda: robot.axes.stop_latch.engage("a test"))
    steps = MOVE + "  - wait: {time_s: 5}\n  - line: {by: {z: 0.05}}\n"
    with pytest.raises(OperationError, match=r"steps\.1\.wait: stopped at step 2 of 3: .*a test"):
        programs.run(program(steps))
    robot.reset()
    programs.resume()
    assert programs.state.state == "done"


def test_a_fault_ends_it_and_after_recovery_it_is_resumed(robot: Robot, programs: Programs) -> None:
    once(robot, lambda: positions(robot)[2] > 0.5, lambda: robot.fault_injector.trip(1, 0x2310))
    with pytest.raises(OperationError, match=r"stopped at step 1 of 1: .*joint2"):
        programs.run(program(MOVE))
    with pytest.raises(NotReady, match="joint2"):
        programs.resume()
    robot.recover()
    before = positions(robot)
    robot.step(500)
    assert positions(robot) == pytest.approx(before, abs=1e-4)
    programs.resume()
    assert positions(robot) == pytest.approx(list(READY.values()), abs=2e-3)


def test_an_arm_that_was_moved_meanwhile_is_not_moved_by_surprise(
    robot: Robot, programs: Programs
) -> None:
    once(robot, lambda: positions(robot)[2] > 0.5, lambda: programs.stop("by the test"))
    with pytest.raises(OperationError, match="by the test"):
        programs.run(program(MOVE))
    moved = np.array([positions(robot)])
    moved[0, 0] += 0.1
    request = TrajectoryRequest(robot.joint_names, np.array([1.0]), moved)
    with robot.follower.follow(request) as execution:
        while execution.outcome is None:
            robot.step(10)
    with pytest.raises(NotReady, match=r"joint1 was moved by 0\.1\d\d rad since the last step"):
        programs.resume()
    programs.run(program(MOVE))
    assert positions(robot) == pytest.approx(list(READY.values()), abs=2e-3)


def test_a_goal_of_another_client_ends_it(robot: Robot, programs: Programs) -> None:
    def other() -> None:
        target = robot.image.position_command[:6].copy()[None]
        request = TrajectoryRequest(robot.joint_names, np.array([3.0]), target)
        taken.append(robot.follower.follow(request))
        taken[0].__enter__()

    taken: list[Any] = []
    steps = MOVE + "  - wait: {time_s: 1}\n  - line: {by: {z: 0.05}}\n"

    def tick() -> None:
        if programs.state.step == 2 and not taken:
            other()

    with pytest.raises(OperationError, match="stopped at step 3 of 3: the joints move"):
        programs.run(program(steps), tick)
    taken[0].__exit__(None, None, None)


def test_a_pause_holds_the_program_and_its_next_step(robot: Robot, programs: Programs) -> None:
    seen: list[tuple[str, float]] = []
    ticks = {"n": 0}

    def tick() -> None:
        if programs.state.progress > 0.4 and not ticks["n"]:
            programs.pause()
        if robot.axes.speed.paused:
            seen.append((programs.state.state, positions(robot)[2]))
            ticks["n"] += 1
            if ticks["n"] == 300:
                programs.proceed()

    programs.run(program(MOVE + "  - message: there\n"), tick)
    assert {state for state, _ in seen} == {"paused"}
    assert seen[-1][1] == pytest.approx(seen[-50][1], abs=1e-6)
    assert seen[-1][1] < 1.3
    assert programs.state.state == "done"
    with pytest.raises(NotReady, match="no program runs"):
        programs.pause()


def test_single_steps(robot: Robot, programs: Programs) -> None:
    whole = program("  - repeat: {times: 2, steps: [{message: a}, {message: b}]}\n")
    for executed in (1, 2, 3):
        programs.step(whole)
        assert (programs.state.executed, programs.state.state) == (executed, "stopped")
    assert programs.state.step == 2
    programs.step(whole)
    assert (programs.state.executed, programs.state.state) == (4, "done")
    programs.step(whole)  # anew
    assert (programs.state.executed, programs.state.state) == (1, "stopped")
    programs.resume()
    assert (programs.state.executed, programs.state.state) == (4, "done")


def test_it_waits_for_an_input_and_for_the_operator(robot: Robot, programs: Programs) -> None:
    steps = "  - wait: {input: part, timeout_s: 2}\n"
    began_ns = robot.clock.now_ns()
    with pytest.raises(OperationError, match="input part is not on after 2 s"):
        programs.run(program(steps))
    assert robot.clock.now_ns() - began_ns == pytest.approx(2e9, rel=0.05)
    due_ns = robot.clock.now_ns() + 10**9
    once(
        robot,
        lambda: robot.clock.now_ns() > due_ns,
        lambda: robot.fault_injector.set_input_bit(0, 3, True),
    )
    programs.resume()
    assert programs.state.state == "done"
    waiting: list[str] = []

    def tick() -> None:
        if programs.state.message:
            waiting.append(programs.state.state)
            if len(waiting) == 50:
                programs.proceed()

    programs.run(program("  - message: {text: insert a part, wait: true}\n"), tick)
    assert waiting.count("waiting") >= 49
    assert programs.state.state == "done"


def test_an_endless_program_runs_until_it_is_stopped(robot: Robot, programs: Programs) -> None:
    count = {"n": 0}

    def tick() -> None:
        count["n"] += 1
        if programs.state.executed == 20:
            programs.stop()

    with pytest.raises(OperationError, match="by the operator"):
        programs.run(program("  - repeat: {steps: [{message: again}]}\n"), tick)


def test_a_loop_that_leads_on_for_ever_is_refused(
    programs: Programs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robotd_teach.program_check.MAX_MOTIONS", 20)
    endless = program(MOVE + "  - repeat: {steps: [{line: {by: {z: 0.0001}}}]}\n")
    with pytest.raises(DescriptorError, match=r"line: repeated steps lead to ever new places: at"):
        programs.check(endless)


def test_one_program_runs_at_a_time(programs: Programs) -> None:
    refused: list[str] = []

    def tick() -> None:
        if not refused:
            with pytest.raises(NotReady, match="a program runs already: stop it first"):
                programs.run(program(MOVE))
            refused.append("")

    programs.run(program(MOVE), tick)
    assert refused


def test_nothing_runs_by_itself_after_a_restart(file: Path) -> None:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        programs = robot.feature(Programs)
        once(robot, lambda: positions(robot)[2] > 0.5, lambda: programs.stop("by the test"))
        with pytest.raises(OperationError, match="by the test"):
            programs.run(program(MOVE))
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        programs = robot.feature(Programs)
        before = positions(robot)
        robot.step(500)
        assert positions(robot) == pytest.approx(before, abs=1e-6)
        assert programs.state.state == "none"
        with pytest.raises(NotReady, match="no program was stopped since robotd was started"):
            programs.resume()


def test_a_sequence_is_one_motion_and_is_resumed_on_its_path(
    robot: Robot, programs: Programs
) -> None:
    segments = (
        "      - line: {by: {y: 0.06}}\n"
        "      - arc: {centre: {by: {z: 0.04}}, angle: 1.5, turns: false, speed: 0.5}\n"
        "        outputs: [{name: lamp, on: true, at_m: 0.01}]\n"
        "      - spline: {through: [{by: {y: 0.02}}, {by: {y: -0.04, z: 0.02}}]}\n"
        "      - move: {pose: ready}\n"
    )
    cell = program(MOVE + "  - sequence:\n      blend_m: 0.01\n      segments:\n" + segments)
    stopped: list[float] = []

    def stop_inside() -> None:
        if programs.state.step == 2 and 0.3 < programs.state.progress < 0.9 and not stopped:
            stopped.append(programs.state.progress)
            robot.stop()

    assert not robot.io.output_bit(0, 1)
    with pytest.raises(OperationError, match=r"steps\.1\.sequence: stopped at step 2 of 2"):
        programs.run(cell, stop_inside)
    assert stopped
    assert positions(robot) != pytest.approx(list(READY.values()), abs=1e-2)
    robot.reset()
    programs.resume()
    assert positions(robot) == pytest.approx(list(READY.values()), abs=1e-3)
    assert robot.io.output_bit(0, 1)
