"""``robotd doctor``: check this computer, with the command that mends each finding."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict

import click

from robotd.api import Finding, InvalidArgument, MachineContext, diagnose, doctors, unknown_name
from robotd.api.commands import ExitCode, as_json, heading, load_robot

OWN = ("computer", "network", "installation")


@click.command("doctor")
@click.option(
    "--robot",
    "robots",
    multiple=True,
    metavar="NAME|FILE",
    help="Also check for this robot, and its backend; may be repeated.",
)
@click.option(
    "--backend",
    "backends",
    multiple=True,
    metavar="NAME",
    help="Also run the checks of this backend; may be repeated.",
)
@click.option(
    "--devices", is_flag=True, help="Backends may open their network and list what answers."
)
@as_json
def doctor(
    robots: Sequence[str], backends: Sequence[str], *, devices: bool, as_json: bool
) -> ExitCode:
    """Check this computer: kernel, cores, limits, network of ROS, clock, disk, versions.

    Each finding has the command that mends it. Nothing is changed and nothing moves. The status is
    1 when a robot cannot run here. When you ask for help, send all that it prints.
    """
    known = doctors()
    for name in backends:
        if name not in known:
            raise InvalidArgument(unknown_name("doctor", name, known))
    descriptors = tuple(map(load_robot, robots))
    used = [descriptor.backend for descriptor in descriptors if descriptor.backend in known]
    context = MachineContext(descriptors, asks_devices=devices)
    found: dict[str, list[Finding]] = {}
    for name in dict.fromkeys((*OWN, *used, *backends)):
        found[name] = list(diagnose(name, context))
        if not as_json:
            click.echo(heading(name))
            for finding in found[name]:
                click.echo(finding.text)
    if as_json:
        click.echo(
            json.dumps({name: [*map(asdict, checks)] for name, checks in found.items()}, indent=2)
        )
    elif left_out := [name for name in known if name not in found]:
        click.echo(f"\nbackends with checks of their own: --backend {' | '.join(left_out)}")
    has_failed = any(
        finding.verdict == "failed" for findings in found.values() for finding in findings
    )
    return ExitCode.FAILED if has_failed else ExitCode.OK
