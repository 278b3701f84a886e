"""Run a folder of URDFs through new-robot, check and the simulation; print a table.

    python tools/urdf_runs.py FOLDER [--peer]

Each file is made a robot with the options that its own errors propose, checked, opened on the
simulation in simulated time, and every joint and the base are moved. The table counts the options
that were needed, files without a moving joint, and those that no option answers. With ``--peer``,
limits and link poses are compared with those of pinocchio, which must be installed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import re
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from click.testing import CliRunner

from robotd.cli.main import main as cli
from robotd.clock.simulated import SteppedClock
from robotd.control.loop.setpoint_source import Outcome
from robotd.descriptor.urdf import read_urdf
from robotd.motion import TrajectoryRequest
from robotd.robot import Robot, open_robot

MOTION_S = 2.0
TIMEOUT_S = 120.0
ASKS = re.compile(r"--(?:no-base|(?:gripper|passive|limits|wheels|wheel-radius) [^\s;]+)")
NO_ROBOT = re.compile(r"no joint moves|has no link")  # an object, a part, macros
ANSWERS = {"METRES": "0.1", "LOWER,UPPER": "-1,1"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--peer", action="store_true")
    options = parser.parse_args()
    files = sorted(
        path for path in options.folder.rglob("*") if path.name.endswith((".urdf", ".urdf.xacro"))
    )
    outcomes: Counter[str] = Counter()
    with multiprocessing.Pool(2, maxtasksperchild=8) as pool:
        runs = [(file, pool.apply_async(run, (file, options.peer))) for file in files]
        for file, result in runs:
            try:
                outcome, text = result.get(TIMEOUT_S)
            except multiprocessing.TimeoutError:
                outcome, text = "hangs", ""
            outcomes[outcome] += 1
            print(f"{outcome:18} {file.relative_to(options.folder)}  {text}", flush=True)
        pool.terminate()
    print(f"{len(files)} files:", ", ".join(f"{n} {what}" for what, n in outcomes.most_common()))


def run(file: Path, peer: bool) -> tuple[str, str]:
    """Return what became of ``file``: one word, and a text."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            return _run(file, Path(folder), peer)
    except Exception as error:  # noqa: BLE001 - a finding, whatever it is
        return "fails", f"{type(error).__name__}: {error}"


def _run(file: Path, folder: Path, peer: bool) -> tuple[str, str]:
    options: list[str] = []
    while True:
        command = ["new-robot", "it", "--urdf", str(file), "--into", str(folder), *options]
        result = CliRunner().invoke(cli, command, prog_name="robotd")
        if result.exit_code == 0:
            break
        text = result.stderr.strip() or result.output.strip() or repr(result.exception)
        answers = [ask.rstrip(",:").split(" ", 1) for ask in ASKS.findall(text)]
        if "LEFT,RIGHT" in str(answers):  # a name for each wheel comes with the question
            answers = [row for row in answers if row[-1] != "LEFT,RIGHT"]
        answer = next((row for row in answers if row[0] not in options), None)
        if answer is None or (folder / "it").exists():
            outcome = "no robot" if NO_ROBOT.search(text) else "rejected"
            return outcome, text.replace("\n", " | ").replace(f"{file.parent}/", "")[:300]
        if answer[0] == "--no-base":
            options = []
        options += [ANSWERS.get(word, word) for word in answer]
    text = " ".join(options)
    count = sum(word.startswith("--") for word in options)
    if peer:
        compare_with_pinocchio(folder / "it" / "it.urdf")
    with open_robot(folder / "it" / "robot.yaml", clock=SteppedClock()) as robot:
        move(robot)
    warnings = [line for line in result.output.splitlines() if line.startswith("warn")]
    outcome = ("moves", "moves, 1 option")[count] if count < 2 else f"moves, {count} options"
    return outcome, f"{text} {len(warnings)} warnings" if warnings else text


def move(robot: Robot) -> None:
    """Move every joint by a fifth of its range, and the base."""
    wanted = {}
    for joint, now in zip(robot.descriptor.joints, robot.image.position_command, strict=False):
        step = min(0.2 * (joint.upper - joint.lower), 0.3 * joint.velocity * MOTION_S)
        wanted[joint.name] = now + step if now + step < joint.upper else now - step
    with ExitStack() as stack:
        executions = []
        for group in robot.groups.values() if robot.joint_names else ():
            row = [wanted[name] for name in group.joint_names]
            goal = TrajectoryRequest.from_rows(group.joint_names, [MOTION_S], [row])
            executions.append(stack.enter_context(group.follower.follow(goal)))
        robot.step(round((MOTION_S + 2.0) * robot.descriptor.cycle.rate_hz))
        for execution in executions:
            if execution.outcome is not Outcome.SUCCEEDED:
                raise RuntimeError(execution.message or "goal not reached")
    if robot.base is not None:
        deadline = time.monotonic() + 20.0
        while robot.base.pose.x < 0.02:
            if time.monotonic() > deadline:
                raise RuntimeError("the base does not move")
            robot.base.command(0.1, 0.0)
            robot.step(5)
            time.sleep(1e-3)  # for the thread that claims the wheels
    if robot.descriptor.gripper is not None and not robot.joint_names and robot.base is None:
        raise RuntimeError("nothing moves")


def compare_with_pinocchio(path: Path) -> None:
    """Raise ValueError where limits or link poses differ from those of pinocchio."""
    import pinocchio  # type: ignore[import-not-found]

    urdf = read_urdf(path)
    try:
        model = pinocchio.buildModelFromUrdf(str(path))
    except ValueError:  # it refuses the file, such as one without limits
        return
    random = np.random.default_rng(1)
    data, places, q = model.createData(), {}, pinocchio.neutral(model)
    for joint in urdf.joints:
        if joint.moves and joint.mimic is None:
            places[joint.name] = float(random.uniform(-1, 1))
    for joint in filter(lambda joint: joint.moves, urdf.joints):  # its mimics are independent
        index = model.joints[model.getJointId(joint.name)].idx_q
        place = urdf.position(joint, places)
        if joint.type == "continuous":
            q[index : index + 2] = np.cos(place), np.sin(place)
            continue
        q[index] = place
        theirs: Any = (model.lowerPositionLimit[index], model.upperPositionLimit[index])
        if joint.has_range and theirs != (joint.lower, joint.upper) and joint.soft is None:
            raise ValueError(f"{joint.name}: {joint.lower, joint.upper}, pinocchio {theirs}")
    pinocchio.framesForwardKinematics(model, data, q)
    for link in urdf.links:
        theirs = data.oMf[model.getFrameId(link, pinocchio.BODY)].homogeneous
        if np.abs(theirs - urdf.pose(link, places)).max() > 1e-9:
            raise ValueError(f"link {link} is elsewhere in pinocchio")


if __name__ == "__main__":
    main()
