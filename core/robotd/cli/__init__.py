"""The command line: its group, ``run`` and ``check``; other commands are found by entry points."""

from robotd.stop_signals import ended_by_interrupt

with ended_by_interrupt():
    from robotd.cli.main import main

__all__ = ["main"]
