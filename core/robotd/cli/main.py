"""The command ``robotd``: a group whose commands are imported when they are called."""

from __future__ import annotations

import os

import click

from robotd.cli.group import RobotdGroup

# Before NumPy: no command multiplies large matrices, and the threads of OpenBLAS spin at the start.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMANDS = {
    "run": "Serve the robot until Ctrl-C.",
    "check": "Check a robot's files and plugins, without hardware and without ROS.",
    "export": "Print the configuration of a client of the robot, or its URDF.",
    "robots": "List the robots that can be run.",
    "backends": "List the installed backends, and why one cannot load.",
    "nodes": "List the ROS nodes that a robot can name.",
    "status": "Show connection, axes and tool pose of the running robot.",
    "move": "Move joints of the running arm.",
    "jog": "Move one joint of the running arm by an increment, or axes by keys.",
    "gripper": "Open or close the gripper of the running robot.",
    "output": "Set an output of the running robot by its name in the descriptor.",
    "servo": "Switch the servos of the running robot.",
    "stop": "Stop all motion of the running robot, until a reset.",
    "reset": "Allow motion again after a stop. Nothing moves.",
    "speed": "Set the speed of all motion of the running robot, 0 to 100 %.",
    "pause": "Bring motion to rest on its path, to be resumed.",
    "resume": "Resume motion after a pause.",
    "recover": "Bring the running robot back after a fault. Nothing moves.",
    "sdo": "Read and write objects (SDO) of the running robot's drives.",
    "snapshot": "Save the last seconds of the running robot.",
    "explain": "Explain a recording, or an alarm, error or abort code.",
    "record": "Record the running robot, or repair a recording.",
    "page": "Serve the live pages of all robots of the ROS domain.",
    "sim": "Scenarios and faults for the simulation.",
    "commission": "Lead through the first switch-on of a real axis.",
    "conform": "Run the conformance checks on a backend. Axes move.",
    "new-robot": "Write a robot's folder from its URDF or its drives, ready for the simulation.",
    "new-backend": "Write an installable backend package that passes the checks, to start from.",
}
"""Commands with their summaries; ``RobotdGroup`` says where they are.

``robotd --help`` needs the summaries without importing NumPy, pydantic or ROS, which would take
0.7 s instead of 0.2; a test compares them with the commands' own.
"""


@click.group(
    cls=RobotdGroup,
    summaries=COMMANDS,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Without a command it is 'run': robotd --robot cr3a --backend sim",
)
@click.version_option(package_name="robotd", message="robotd %(version)s")
def main() -> None:
    """Serve a robot on ROS 2, whatever drives it."""
