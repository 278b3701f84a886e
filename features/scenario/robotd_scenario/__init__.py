"""Scenarios: faults, commands and expectations for a simulated robot.

``fault_kinds`` models the faults, ``fault_schedule`` injects them in the control loop,
``program`` models commands and checks, ``scenario_run`` executes them, ``scenario_model`` is
the file.
"""

from robotd_scenario.fault_kinds import FAULTS, Fault, nested, validate_fault
from robotd_scenario.fault_schedule import FaultSchedule
from robotd_scenario.scenario_model import Scenario, load_scenario
from robotd_scenario.scenario_run import Result, ScenarioRun

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
