"""Alarm codes of the simulated drives for ``robotd explain``."""

from __future__ import annotations

from robotd.api import CodeTable
from robotd_cia402.code_tables import drive_remedy
from robotd_sim.alarms import ALARMS

DRIVE_ALARMS = CodeTable("alarm of a simulated drive", ALARMS, remedy=drive_remedy)
