"""``robotd path import`` and ``export``: paths from recordings and datasets, and back."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from robotd.api.commands import (
    FILE,
    IntegerRange,
    NumberRange,
    escaped,
    load_robot,
    log_options,
    which_robot,
)

if TYPE_CHECKING:  # they need NumPy
    from robotd.api.models import Override
    from robotd.api.robots import JointLimits
    from robotd_teach.joint_motion_file import FileMotion

MAX_RATE_HZ = 1000
STATE = "observation.state"


@click.command("import")
@click.argument("source", metavar="FILE.mcap|DATASET[#EPISODE]")
@click.option("--name", required=True, help="Name of the path.")
@which_robot
@click.option("--group", default="", metavar="NAME", help="Joint group, where there are several.")
@click.option("--replace", is_flag=True, help="Replace a path of this name.")
@click.option("--begin-s", type=NumberRange(0.0), default=0.0, help="Leave out what is before.")
@click.option("--end-s", type=NumberRange(0.0), default=math.inf, help="Leave out what is later.")
@click.option("--topic", default="", help="Of an MCAP file; by default /joint_states.")
@click.option(
    "--feature", default=STATE, show_default=True, help="Of a dataset: this, or 'action'."
)
@click.option(
    "--unit",
    type=click.Choice(["rad", "deg", "percent"]),
    help="Of a dataset's positions; by default rad where it is of a robot of robotd.",
)
@click.option("--calibration", type=FILE, help="LeRobot's calibration of the arm, for percent.")
@log_options
def import_path(
    *,
    source: str,
    name: str,
    robot: str,
    variant: str | None,
    overrides: tuple[Override, ...],
    group: str,
    replace: bool,
    begin_s: float,
    end_s: float,
    topic: str,
    feature: str,
    unit: str | None,
    calibration: Path | None,
) -> None:
    """Make a path of the joint states in an MCAP file, or of an episode of a LeRobot dataset.

    Nothing moves, and no robot has to run. The file is one of robotd or of 'ros2 bag record -s
    mcap'; the dataset is a folder of version 3.0, whose first episode is taken unless '#3' at its
    end names another one.
    """
    from robotd_teach.path_exchange import limits_of, save_motion

    descriptor = load_robot(robot, variant, overrides)
    limits = limits_of(descriptor, group)
    motion = _motion(
        source, descriptor.name, limits, topic, feature, unit, calibration, begin_s, end_s
    )
    click.echo(escaped(save_motion(descriptor, name, motion, limits, replace=replace)))


def _motion(
    source: str,
    robot: str,
    limits: JointLimits,
    topic: str,
    feature: str,
    unit: str | None,
    calibration: Path | None,
    begin_s: float,
    end_s: float,
) -> FileMotion:
    """Return what the file has. Raises UsageError: an option belongs to the other kind."""
    folder, _, episode = source.rpartition("#") if "#" in source else (source, "", "0")
    if not Path(folder).is_dir():
        if feature != STATE or unit is not None or calibration is not None:
            raise click.UsageError("--feature, --unit and --calibration belong to a dataset")
        from robotd_teach.joint_state_file import read_joint_states

        return read_joint_states(Path(source), robot, limits.names, topic, begin_s, end_s)
    if topic:
        raise click.UsageError("--topic belongs to an MCAP file")
    if not episode.isdecimal():
        raise click.UsageError(f"episode {episode!r} of {folder} is not a number")
    from robotd_teach.lerobot_dataset import AngleUnit, read_episode

    angle = None if unit is None else AngleUnit(unit)
    motion = read_episode(
        Path(folder), int(episode), robot, limits.names, angle, calibration, feature
    )
    return motion.between(begin_s, end_s)


@click.command("export")
@click.argument("name")
@click.argument("target", metavar="FILE.mcap|FOLDER", type=click.Path(path_type=Path))
@which_robot
@click.option(
    "--rate",
    type=IntegerRange(1, MAX_RATE_HZ),
    help="Positions in a second; by default 100 in a file, 30 in a dataset.",
)
@click.option("--task", default="", help="Of a dataset: what is done; by default the name.")
@log_options
def export_path(
    *,
    name: str,
    target: Path,
    robot: str,
    variant: str | None,
    overrides: tuple[Override, ...],
    rate: int | None,
    task: str,
) -> None:
    """Write a path as joint states in a new MCAP file, or as a LeRobot dataset in a new folder.

    Both have the recorded motion, not one that was slowed down or reversed. The dataset has one
    episode, which lerobot-replay plays.
    """
    from robotd_teach import path_exchange

    descriptor = load_robot(robot, variant, overrides)
    click.echo(escaped(path_exchange.export_path(descriptor, name, target, rate or 0, task)))
