"""Pages do what they say: their command blocks are run in order, in a folder of their own.

In a ``console`` block ``$`` begins a command, ``&`` at its end leaves it running, and ``^C`` is
Ctrl-C once the arm moves. Every other line must appear in the output; ``...`` stands for anything,
and a number with a decimal point for any such number. An indented block is commands alone where its
first line begins with a program of ``SHELL``; they must succeed. ``ros2`` is ``ros2_stand_in``, a
recording is the newest one, and a generated package is installed beside the environment. A
command that starts a robot ends those of the blocks before. An indented block, or one of Python,
that begins with an import is a program.

Every page is run, or is in ``NOT_RUN`` with the reason; so is every command of a page that is run.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from textwrap import dedent
from typing import Any, NamedTuple

import pytest
from sensor_msgs.msg import JointState
from tests.ros.robot_process import BACKEND, Client, RobotProcess, wait_until

from robotd.descriptor import load_robot_descriptor
from robotd_testing.domain import own_domain

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
ARM = ",".join(load_robot_descriptor("cr3a").nodes)
SHELL = ("robotd", "ros2", "colcon", "docker", "make", "pip", "python", "source", "yq")
INSTALL = "pip install --editable ./robotd-"  # of a package that the page has generated
RECORDING = re.compile(r"\bFILE\b|\bcr3a-\d+-\d+-fault\.mcap")
BROUGHT = "the test brings it"
ROS = "needs an installed ROS 2"
SKIPPED = {  # commands of the pages that are run
    r"source ": BROUGHT,
    rf"pip (?!{INSTALL[4:]})": "from an index of packages; tests/contract/test_packaging.py",
    r"python examples/robot_learning/lerobot_": "needs LeRobot; tests/features/learning",
    r"robotd new-backend acme --minimal": "the same folder as the full package, which is taken",
    r".*--page": "a server; tests/features/page",
    r".*--keys": "needs a terminal; tests/ros/test_operator_tools.py",
    r"robotd tool frame (tf|follow):": "of another program; tests/ros/test_world_frames.py",
    r"robotd move left_finger": "of a finger in a group; tests/ros/test_joint_groups.py",
    r"robotd conform --backend acme": "of a generated package; tests/features/conformance/runs",
    r"robotd new-robot rover ": "of a file that the reader has; tests/features/new_robot",
    r"colcon |ros2 (launch|run) ": ROS,
    r"(ROBOTS=8 )?docker |yq ": "needs a program that no test environment has",
}
NOT_RUN = {  # pages
    "docs/how-to/paths.md": "records until Ctrl-C; tests/ros/test_paths.py",
    "docs/how-to/canopen.md": "needs an adapter; simulated in tests/ros/test_canopen.py",
    "docs/how-to/ci.md": "of another project; examples/project is run by test_example_project.py",
    "docs/how-to/commission.md": "asks a person; tests/features/commissioning",
    "docs/how-to/ethercat.md": "needs root and a port; tests/plugins/ethercat",
    "docs/how-to/install.md": "installs; tests/tools/test_install_tool.py, make dist",
    "docs/how-to/isaac-sim.md": "needs Isaac Sim; its export is in tests/contract/test_export.py",
    "docs/how-to/dobot.md": "needs an arm at a network; tests/plugins/dobot",
    "docs/how-to/franka.md": "needs an arm at a network; tests/plugins/franka",
    "docs/how-to/guiding.md": "needs a hand; tests/ros/test_guiding.py",
    "docs/how-to/launch.md": f"{ROS}; tests/ros/test_lifecycle.py",
    "docs/how-to/mujoco.md": "needs an extra; tests/ros/test_mujoco.py",
    "docs/how-to/page.md": "needs a browser; tests/features/page",
    "docs/how-to/service.md": "needs root and systemd; tests/features/service",
    "docs/how-to/several-computers.md": "needs computers; tests/ros/test_discovery_server.py",
    "docs/how-to/sequences.md": "programs in Python; test_the_programs_of_sequences_run",
    "docs/how-to/serial-arms.md": "needs an arm at a serial port",
    "docs/how-to/whole-arm.md": "of an arm at a network; tests/plugins/dobot",
    "docs/how-to/wmx.md": "needs the vendor's engine",
}
SAVED = {  # the first block of the language that the suffix names
    "docs/tutorial/own-robot.md": "press.urdf",
    "docs/tutorial/teach-an-arm.md": "cell.yaml",
}
LANGUAGES = {".urdf": "xml", ".yaml": "yaml"}
BESIDE = {  # robots that a page takes for granted
    "docs/how-to/operate.md": "robotd --robot cr3a --set inputs.part_present=0.3"
    " --set outputs.lamp=0.1",
    "docs/how-to/bases.md": "robotd --robot baymax",
    "docs/how-to/goals.md": "robotd --robot cr3a",
    "docs/tutorial/teach-an-arm.md": "robotd --robot cr3a",
    "docs/how-to/migrate.md": "robotd --robot cr3a"
    f" --set nodes=[{ARM},wmx_robot_option_node,axis_reference_node]"
    " --set backends.sim.initial_position_rad=[0,0.3,1.4,-0.2,1.2,0]",
    "docs/how-to/poses.md": "robotd --robot cr3a",
    "docs/how-to/programs.md": "robotd --robot cr3a",
    "docs/how-to/record.md": "robotd --robot cr3a --record-dir .",
    "docs/how-to/tool-stream.md": f"robotd --robot cr3a --set nodes=[{ARM},servo_node]",
}
PAGES = (
    "README.md",
    "docs/tutorial/first-arm.md",
    "docs/tutorial/own-robot.md",
    "docs/tutorial/teach-an-arm.md",
    "docs/tutorial/move-the-tool.md",
    "docs/tutorial/first-backend.md",
    "docs/how-to/operate.md",
    "docs/how-to/groups.md",
    "docs/how-to/two-robots.md",
    "docs/how-to/bases.md",
    "docs/how-to/goals.md",
    "docs/how-to/migrate.md",
    "docs/how-to/moveit.md",
    "docs/how-to/nav2.md",
    "docs/how-to/tool-stream.md",
    "docs/how-to/poses.md",
    "docs/how-to/programs.md",
    "docs/how-to/stream.md",
    "docs/how-to/record.md",
    "docs/how-to/robot-learning.md",
    "docs/how-to/plugin-base.md",
    "docs/how-to/plugin-feature.md",
    "docs/how-to/plugin-node.md",
    "docs/how-to/plugin-robot.md",
)
RATE_HZ = "125"  # of the control loops: no page shows timing, and the processor is shared
MOVING_RAD_S = 0.05
COMMAND_S = 90


class Command(NamedTuple):
    """A command of a page: whether it is left running, and whether it is interrupted."""

    text: str
    is_left: bool
    is_interrupted: bool

    @property
    def starts_robot(self) -> bool:
        return re.match(r"make run|robotd (run|--robot)\b", self.text) is not None


class Block(NamedTuple):
    """Commands that are run one after the other, and the lines that their output has."""

    commands: list[Command]
    lines: list[str]


def blocks(page: str) -> Iterator[Block]:
    text = (ROOT / page).read_text(encoding="utf-8")
    for found in re.finditer(r"^```(\w*)\n([\s\S]*?)^```|\n\n((?:    .+\n)+)", text, re.MULTILINE):
        kind, fenced, indented = found.groups()
        if kind == "console":
            yield shown(fenced)
        elif kind == "bash" or (indented and indented.split()[0] in SHELL):
            yield plain(fenced or indented)
        elif (text := dedent(fenced or indented)).startswith(("from ", "import ")):
            yield Block([Command(shlex.join([sys.executable, "-c", text]), False, False)], [])


def shown(text: str) -> Block:
    found = re.findall(r"^\$ (.*?)( &)?\n(\^C\n)?", text, re.MULTILINE)
    lines = [line for line in text.splitlines() if not line.startswith(("$ ", "^C"))]
    return Block([Command(word, bool(left), bool(stop)) for word, left, stop in found], lines)


def plain(text: str) -> Block:
    """The commands of a block without output."""
    words = re.sub(r" *\\\n *", " ", text).splitlines()
    words = [re.sub(r"\s+#\s.*", "", word).strip() for word in words]
    return Block(
        [Command(word.removesuffix(" &"), word.endswith(" &"), False) for word in words], []
    )


def filled(text: str) -> str:
    """A command with the newest recording for one that the reader has, and a folder of its own."""
    recordings = sorted(Path.cwd().glob("*.mcap"), key=lambda path: path.stat().st_mtime)
    text = text.replace("/data/recordings", "recordings")
    return RECORDING.sub(recordings[-1].name, text) if recordings else text


def taken(words: list[str], option: str) -> str:
    """Take an option out of ``words``; its value, "" where it is not there."""
    if option not in words:
        return ""
    at = words.index(option)
    del words[at]
    return words.pop(at)


def is_skipped(command: Command) -> bool:
    return any(re.match(skipped, command.text) for skipped in SKIPPED)


def pattern(line: str) -> str:
    parts = re.split(r"([-+]?\d+\.\d+|\.\.\.)", " ".join(line.split()))
    wild = {True: ".*", False: r"[-+]?\d+\.\d+"}
    return "".join(
        wild[part == "..."] if number % 2 else re.escape(part) for number, part in enumerate(parts)
    )


def check(lines: list[str], output: str) -> None:
    plain = " ".join(output.split())
    for line in lines:
        assert re.search(pattern(line), plain), f"{line!r} is not in the output:\n{output}"


class Started(NamedTuple):
    """A robot that a page has started, and the lines that it shows of it."""

    robot: RobotProcess
    lines: list[str]


class Terminal:
    """Runs the blocks of a page, in the present folder and a ROS domain of its own."""

    def __init__(self, domain: int) -> None:
        self._domain, self._started = domain, list[Started]()
        self._client: Client | None = None
        self._joints: list[Any] = []
        program = Path("ros2")
        program.write_text(f'#!/bin/sh\nexec {sys.executable} -m tests.ros.ros2_stand_in "$@"\n')
        program.chmod(0o755)
        Path("examples").symlink_to(ROOT / "examples")
        self._site = Path.cwd() / "site"  # of packages that the page installs
        self._environment = os.environ | {
            "PYTHONPATH": f"{self._site}:{ROOT}",
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PATH": f"{Path.cwd()}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        }

    def run(self, block: Block) -> None:
        """Run what is before the robots of a block, start these together, and run the others."""
        commands = [command for command in block.commands if not is_skipped(command)]
        starts = [command for command in commands if command.starts_robot]
        first = commands.index(starts[0]) if starts else 0
        outputs = self._finished(commands[:first], block)
        if starts:
            self.close()
            self._started = [
                Started(self._start(filled(start.text)), block.lines) for start in starts
            ]
            for started in self._started:
                started.robot.wait_ready()
        others = [command for command in commands[first:] if not command.starts_robot]
        outputs += self._finished(others, block)
        if not starts:
            check(block.lines, "".join(outputs))

    def _finished(self, commands: list[Command], block: Block) -> list[str]:
        """Run commands one after the other, those that are left beside them; their outputs."""
        left, outputs = [], []
        is_error = any("robotd: error" in line for line in block.lines)
        for command in commands:
            process = self._begin(command)
            if command.is_left:
                left.append(process)
                continue
            outputs.append(process.communicate(timeout=COMMAND_S)[0])
            assert is_error or process.returncode in (0, 130), f"{command.text}: {outputs[-1]}"
        return outputs + [process.communicate(timeout=COMMAND_S)[0] for process in left]

    def close(self) -> None:
        """End the robots, and compare their output with what is shown."""
        if self._client is not None:
            self._client.close()
        self._client, started, self._started = None, self._started, []
        for robot in started:
            assert robot.robot.end(signal.SIGINT) == 0
            check(robot.lines, robot.robot.output)
            robot.robot.__exit__()

    def _start(self, text: str) -> RobotProcess:
        words = shlex.split(text.replace("make run", "robotd --robot cr3a --backend sim"))[1:]
        words = words[words[0] == "run" :]
        robot, backend = taken(words, "--robot"), taken(words, "--backend") or BACKEND
        own = {"PYTHONPATH": self._environment["PYTHONPATH"]}
        rate = ("--rate", RATE_HZ, *words)
        return RobotProcess(
            *rate, robot=robot, backend=backend, domain=self._domain, environment=own
        )

    def _begin(self, command: Command) -> subprocess.Popen[str]:
        if (command.is_left or command.is_interrupted) and self._client is None:
            self._client = Client(self._domain)
            self._joints = self._client.listen(JointState, "/joint_states")
            self._client.next(self._joints)
        text = filled(command.text)
        if text.startswith(INSTALL):
            offline = "--no-index --no-deps --no-build-isolation --quiet"
            text = text.replace(
                " --editable", f" {offline} --target {shlex.quote(str(self._site))}"
            )
            text = f"{shlex.quote(sys.executable)} -m {text}"
        process = subprocess.Popen(
            f"exec {text}",
            shell=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self._environment,
        )
        if command.is_left or command.is_interrupted:
            wait_until(lambda: self._is_moving(process), f"no motion by {command.text!r}")
        if command.is_interrupted:
            process.send_signal(signal.SIGINT)
        return process

    def _is_moving(self, process: subprocess.Popen[str]) -> bool:
        assert process.poll() is None, process.communicate()[0]
        return any(abs(speed) > MOVING_RAD_S for speed in self._joints[-1].velocity)


@contextmanager
def terminal() -> Iterator[Terminal]:
    with own_domain() as domain, ExitStack() as stack:
        made = Terminal(domain)
        stack.callback(lambda: [robot.robot.end() for robot in made._started])
        yield made
        made.close()


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_a_page_do_what_it_shows(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if (name := SAVED.get(page)) is not None:
        text = (ROOT / page).read_text(encoding="utf-8")
        language = LANGUAGES[Path(name).suffix]
        saved = re.search(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        assert saved
        (tmp_path / name).write_text(saved[1], encoding="utf-8")
    with terminal() as shell:
        if (start := BESIDE.get(page)) is not None:
            shell.run(Block([Command(start, False, False)], []))
        for block in blocks(page):
            shell.run(block)


def test_every_page_is_run_or_says_why_not() -> None:
    folders = (ROOT / "docs" / name for name in ("how-to", "tutorial"))
    pages = [str(page.relative_to(ROOT)) for folder in folders for page in folder.glob("*.md")]
    assert sorted([*PAGES, *NOT_RUN]) == sorted(["README.md", *pages])
    commands = [command for page in PAGES for block in blocks(page) for command in block.commands]
    for skipped in SKIPPED:
        assert any(re.match(skipped, command.text) for command in commands), skipped


def test_the_program_of_the_readme_moves_the_arm() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    result = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, timeout=90
    )
    assert "goal reached" in result.stdout


@pytest.mark.parametrize("program", range(2))
def test_the_programs_of_sequences_run(program: int) -> None:
    text = (ROOT / "docs/how-to/sequences.md").read_text(encoding="utf-8")
    found = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    programs = [block for block in found if block.startswith("from robotd import")]
    assert len(programs) == 2
    subprocess.run([sys.executable, "-c", programs[program]], check=True, timeout=90)
