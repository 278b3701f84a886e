"""Scenarios: what goes wrong in a simulation, what is commanded, and what is expected.

``faults`` are the kinds of faults, ``schedule`` lets them happen in the cycle, ``program`` is
what a scenario commands and checks, ``run`` does it, ``model`` is the file.
"""

from robotd.scenario.faults import FAULTS, Fault, nested, validate_fault
from robotd.scenario.model import Scenario, load_scenario
from robotd.scenario.run import Result, ScenarioRun
from robotd.scenario.schedule import FaultSchedule

__all__ = [
    "FAULTS",
    "Fault",
    "FaultSchedule",
    "Result",
    "Scenario",
    "ScenarioRun",
    "load_scenario",
    "nested",
    "validate_fault",
]
