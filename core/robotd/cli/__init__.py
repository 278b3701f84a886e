"""The command line: one module per command in ``commands``."""

from robotd.cli.main import main

__all__ = ["main"]
