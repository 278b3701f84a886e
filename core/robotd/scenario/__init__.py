"""Scenarios: what goes wrong in a simulation, what is commanded, and what is expected.

``faults`` are the kinds of faults, ``schedule`` lets them happen in the cycle, ``program`` is
what a scenario commands and checks, ``run`` does it, ``model`` is the file.
"""

from robotd.scenario.fault_kinds import FAULTS, Fault, nested, validate_fault
from robotd.scenario.fault_schedule import FaultSchedule
from robotd.scenario.scenario_model import Scenario, load_scenario
from robotd.scenario.scenario_run import Result, ScenarioRun

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
