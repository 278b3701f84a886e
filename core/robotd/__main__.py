"""``python -m robotd``, the same as ``robotd``."""

from robotd.cli import main

main(prog_name="robotd")
