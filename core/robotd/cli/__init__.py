"""The command line: ``robotd run | check | robots | backends | nodes``."""

from robotd.cli.commands import main

__all__ = ["main"]
