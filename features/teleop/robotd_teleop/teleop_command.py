"""``robotd teleop``: a robot follows a leader arm."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from robotd.api import InvalidArgument, RobotdError
from robotd.api.commands import ExitCode, Interrupt, NumberRange, log_options, stop_signals

if TYPE_CHECKING:
    from robotd.api.robots import Robot
    from robotd_teleop.joint_map import JointMapping
    from robotd_teleop.leader_follower import LeaderFollower

EPILOG = """\b
Examples:
  robotd teleop --leader my_leader/robot.yaml --robot my_arm/robot.yaml
  robotd teleop --leader my_leader/robot.yaml --robot cr3a --map shoulder_pan=joint1 \\
      --map shoulder_lift=joint2:-1 --map elbow_flex=joint3:1:0.5
"""
MAX_ELAPSED_S = 0.1  # a program that was stopped does not leap


@click.command("teleop", epilog=EPILOG)
@click.option("--leader", required=True, metavar="NAME|FILE", help="Arm that is moved by hand.")
@click.option("--leader-backend", metavar="NAME", help="Its backend; by default its own.")
@click.option("--robot", required=True, metavar="NAME|FILE", help="Robot that follows.")
@click.option("--backend", metavar="NAME", help="Its backend; by default its own.")
@click.option("--variant", metavar="NAME", help="Its variant.")
@click.option(
    "--map",
    "mappings",
    multiple=True,
    metavar="LEADER=JOINT[:SCALE[:OFFSET]]",
    help="Joint that a joint of the leader moves, rad; by default those of the same name.",
)
@click.option(
    "--rate",
    "rate_hz",
    type=NumberRange(10, 200),
    default=60,
    show_default=True,
    help="Targets per second.",
)
@click.option(
    "--align-speed",
    type=NumberRange(0.01, 1.0),
    default=0.3,
    show_default=True,
    help="Speed of the approach to the leader, rad/s.",
)
@click.option("--path", metavar="NAME", help="Save the motion of the robot as a path.")
@click.option("--replace", is_flag=True, help="Replace a path of this name.")
@click.option("--yes", is_flag=True, help="Do not ask before the robot moves.")
@log_options
def teleop(
    leader: str,
    leader_backend: str | None,
    robot: str,
    backend: str | None,
    variant: str | None,
    mappings: Sequence[str],
    rate_hz: float,
    align_speed: float,
    path: str | None,
    *,
    replace: bool,
    yes: bool,
) -> ExitCode:
    """Let a robot follow a leader arm, within the robot's own limits. Ctrl-C ends it.

    The robot first moves slowly to the pose of the leader. Where the leader is lost the robot slows
    to rest, and approaches it again. A stop or a fault of the robot ends the command. Ctrl-C,
    SIGTERM and the loss of the terminal end it, too: the robot slows to rest, then its servos go
    off.
    """
    from robotd.api.robots import open_robot
    from robotd_teleop.joint_map import joint_map, parse_mapping
    from robotd_teleop.leader_follower import LeaderFollower

    given = [parse_mapping(text) for text in mappings]
    with (
        Interrupt() as interrupt,
        open_robot(leader, leader_backend, enable=False) as leading,
        open_robot(robot, backend, variant) as following,
    ):
        chosen = joint_map(leading.descriptor, following.descriptor, given)
        if not (yes or interrupt.happened):
            joints = ", ".join(mapping.joint for mapping in chosen)
            text = f"{following.descriptor.name} moves {joints} to the leader at {align_speed:g}"
            with _signals_end_questions():
                click.confirm(f"{text} rad/s. Go on", abort=True)
        with (
            _saved(following, chosen, path, replace=replace),
            LeaderFollower(leading, following, chosen, align_speed) as follower,
        ):
            try:
                _follow(follower, 1.0 / rate_hz, interrupt)
            except RobotdError as error:
                click.echo(f"the robot no longer follows: {error}")
                return ExitCode.FAILED
        click.echo("ended by the operator")
        return ExitCode.OK


@contextmanager
def _saved(
    robot: Robot, mappings: Sequence[JointMapping], path: str | None, *, replace: bool
) -> Iterator[None]:
    """Save the motion in the block as a path; None: do not.

    Raises InvalidArgument: the name is taken, or joints of several groups are moved.
    """
    if path is None:
        yield
        return
    from robotd_teach.paths import Paths

    moved = {mapping.joint for mapping in mappings}
    groups = [name for name, group in robot.groups.items() if moved & {*group.joint_names}]
    if len(groups) > 1:
        raise InvalidArgument(f"a path is of one group, and the leader moves {', '.join(groups)}")
    paths = robot.feature(Paths)
    paths.begin(path, groups[0], replace=replace)
    try:
        yield
    finally:
        click.echo(paths.end())


@contextmanager
def _signals_end_questions() -> Iterator[None]:
    """Let each stop signal raise KeyboardInterrupt, for the time of a question."""
    before = {
        number: signal.signal(number, signal.default_int_handler) for number in stop_signals()
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _follow(follower: LeaderFollower, period_s: float, interrupt: Interrupt) -> None:
    """Follow until a stop signal or an exception ends it; each change of state is printed."""
    shown, before = "", time.monotonic()
    while not interrupt.happened:
        now = time.monotonic()
        known = follower.step(min(now - before, MAX_ELAPSED_S))
        before = now
        state = "following" if follower.alignment.aligned else "approaching the leader"
        state = state if known else "the leader does not answer: waiting"
        if state != shown:
            shown = state
            click.echo(state)
        time.sleep(max(0.0, now + period_s - time.monotonic()))
