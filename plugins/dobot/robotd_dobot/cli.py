"""``robotd dobot``: which arm a controller has, and in which state it is."""

from __future__ import annotations

import json

import click

# Only click is imported at module level: other commands must not load the backend.


@click.group()
def dobot() -> None:
    """Dobot arms on their own controller."""


@dobot.command()
@click.option("--address", required=True, metavar="HOST", help="Controller, such as 192.168.5.1.")
@click.option("--json", "as_json", is_flag=True, help="JSON, which 'new-robot --bus' reads.")
def scan(address: str, *, as_json: bool) -> None:
    """Ask a controller for its model, generation and mode. Nothing is changed and nothing moves."""
    from robotd_dobot.controller_scan import scan as scan_controller

    found = scan_controller({"address": address})
    click.echo(json.dumps(found, indent=2) if as_json else found["controller"])
