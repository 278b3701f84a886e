"""The command line; the commands are in ``commands``."""

from robotd.stop_signals import ended_by_interrupt

with ended_by_interrupt():
    from robotd.cli.main import main

__all__ = ["main"]
