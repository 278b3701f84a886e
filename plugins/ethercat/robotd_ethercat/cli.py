"""``robotd ethercat``: simulate the slaves of a robot."""

from __future__ import annotations

import click

from robotd_ethercat.simulate_command import simulate


@click.group()
def ethercat() -> None:
    """EtherCAT: simulated slaves."""


ethercat.add_command(simulate)
