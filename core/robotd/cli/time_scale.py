"""``--time-scale``: speed of simulated time."""

from __future__ import annotations

import math

import click

from robotd.number_argument import parse_number

SLOWEST, FASTEST = 0.01, 1000.0  # at the slowest a period of 100 ms takes 10 s


def parse_scale(ctx: click.Context, option: click.Parameter, value: str | None) -> float | None:
    """Parse the scale: ``max`` is infinity; None when the option is absent."""
    if value is None:
        return None
    if value == "max":
        return math.inf
    try:
        scale = parse_number(value)
    except ValueError:
        scale = math.nan
    if not SLOWEST <= scale <= FASTEST:
        text = f"{value!r} is neither max nor a number from {SLOWEST:g} to {FASTEST:g}"
        raise click.BadParameter(text)
    return scale


time_scale = click.option(
    "--time-scale",
    metavar="N|max",
    callback=parse_scale,
    help="Simulation: seconds per real second, or as fast as possible; publishes /clock.",
)
