"""The command ``robotd``: a group whose commands are imported when they are called."""

from __future__ import annotations

import os

import click

from robotd.cli.group import RobotdGroup

# Before NumPy: no command multiplies large matrices, and the threads of OpenBLAS spin at the start.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@click.group(
    cls=RobotdGroup,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Without a command it is 'run': robotd --robot cr3a --backend sim",
)
@click.version_option(package_name="robotd", message="robotd %(version)s")
def main() -> None:
    """Serve a robot on ROS 2, whatever drives it."""
