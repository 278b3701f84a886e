"""The command line; the commands are in ``commands``."""

from robotd.cli.main import main

__all__ = ["main"]
