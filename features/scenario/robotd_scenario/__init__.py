"""Scenarios: faults, commands and expectations for a simulated robot.

``fault_kinds`` models the faults, ``fault_schedule`` injects them in the control loop,
``program`` is the file with its commands and checks, ``scenario_run`` executes them.
"""

from typing import TYPE_CHECKING

from robotd.api import lazy_names

if TYPE_CHECKING:
    from robotd_scenario.fault_kinds import FAULTS, Fault, requested_fault, validate_fault
    from robotd_scenario.fault_schedule import FaultSchedule
    from robotd_scenario.program import Scenario, load_scenario
    from robotd_scenario.scenario_run import Result, ScenarioRun
else:  # commands that read a robot's file need the keys of the feature only
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "FAULTS",
    "Fault",
    "FaultSchedule",
    "Result",
    "Scenario",
    "ScenarioRun",
    "load_scenario",
    "requested_fault",
    "validate_fault",
]
