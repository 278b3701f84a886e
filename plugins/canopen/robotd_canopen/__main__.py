"""``python -m robotd_canopen``: the commands of ``robotd canopen``."""

from robotd_canopen.cli import canopen

canopen(prog_name="robotd canopen")
