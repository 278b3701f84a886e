"""``robotd commission``: first switch-on of a real axis."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from robotd.api import DescriptorError
from robotd.api.commands import (
    ExitCode,
    apply_log_options,
    check_backend_overrides,
    load_installed,
    log_options,
    robot_options,
)
from robotd.api.models import Override, RobotDescriptor, load_robot_descriptor
from robotd.api.robots import load_backend
from robotd_commissioning.commission_terminal import CommissionTerminal, Left
from robotd_commissioning.session import Commissioning, CommissionRecord
from robotd_commissioning.steps import STEPS


@click.command("commission")
@robot_options
@click.option("--joint", metavar="NAME", help="Joint to commission; by default all, in order.")
@click.option("--again", is_flag=True, help="Repeat steps that are finished.")
@log_options
def commission(**options: Any) -> ExitCode:
    """Lead through the first switch-on of a real axis.

    Identity, direction, scale, homing, limits, following error and brake, one joint at a time. The
    changes of the robot's file are shown and written on confirmation only. Nothing moves without a
    key held. Ctrl-C leaves; the next call goes on with the first open step.

    For joints on backends that keep scale and direction in the descriptor, such as canopen. WMX
    keeps them in its parameter file, and wheels of a base have no joints: not supported.
    """
    ctx = click.get_current_context()
    if ctx.get_parameter_source("log_level") is ParameterSource.DEFAULT:
        ctx.meta["log_level"] = "warning"  # the log would run into the questions
        apply_log_options()
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise click.UsageError("commissioning needs a terminal")
    with _hangup_interrupts():
        return _commission(**options)


def _commission(
    robot: str,
    variant: str | None,
    overrides: Sequence[Override],
    backend: str | None,
    joint: str | None,
    *,
    again: bool,
) -> ExitCode:
    """Commission the joints; INTERRUPTED when left, FAILED after a change was rejected."""
    search_path = load_installed().search_path

    def load(path: Path | None = None) -> RobotDescriptor:
        return load_robot_descriptor(path or robot, variant, search_path, overrides)

    descriptor = load()
    if descriptor.path is None:
        raise DescriptorError(f"{robot} has no file to write to")
    plugin = load_backend(backend or descriptor.backend)
    check_backend_overrides(overrides, plugin.name)
    record = CommissionRecord(descriptor.path)
    try:
        for name in [joint] if joint else descriptor.joint_names:
            commissioning = Commissioning(load, plugin, name, record, CommissionTerminal)
            if again:
                record.forget(name)
            for step in STEPS:
                if (text := record.finding(name, step)) is not None:
                    click.echo(f"{name}: {step}: {text}")
            if not commissioning.run():
                click.echo("Not written. The step stays open.")
                return ExitCode.FAILED
            click.echo(f"\n{name} is commissioned; {record.path}")
    except (Left, click.Abort, KeyboardInterrupt):
        with suppress(OSError):
            click.echo("\nLeft; the axis is off. Call the command again to go on.")
        return ExitCode.INTERRUPTED
    return ExitCode.OK


@contextmanager
def _hangup_interrupts() -> Iterator[None]:
    """Let the loss of the terminal, SIGQUIT and SIGTERM end a question as Ctrl-C does.

    Ctrl-C itself, too: a program that a script has started in the background ignores it.
    """
    numbers = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM)
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
