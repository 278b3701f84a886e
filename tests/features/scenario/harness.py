"""Scenarios on a small robot: two joints and a gripper, without a parameter file."""

from __future__ import annotations

from typing import Any

from robotd.descriptor import RobotDescriptor
from robotd.plugin.manager import load_backend
from robotd_scenario import Result, Scenario, ScenarioRun

MOVE = {"move": {"to_rad": {"joint1": 1.0}, "time_s": 1.0}}


def robot(**options: Any) -> RobotDescriptor:
    joints = [
        {"name": f"joint{axis + 1}", "axis": axis, "lower_rad": -3.0, "upper_rad": 3.0,
         "velocity_rad_s": 3.0, "acceleration_rad_s2": 10.0}
        for axis in range(2)
    ]  # fmt: skip
    gripper = {"output_byte": 0, "output_bit": 3, "joints": ["finger"], "open_m": 0.0,
               "closed_m": 0.04, "travel_time_s": 0.2}  # fmt: skip
    values = {"schema": 1, "name": "harness", "joints": joints, "gripper": gripper,
              "trajectory": {"path_tolerance_rad": 0.2}}  # fmt: skip
    return RobotDescriptor.model_validate({**values, "backends": {"sim": options}})


def run(
    *program: dict[str, Any],
    faults: list[dict[str, Any]] | None = None,
    descriptor: RobotDescriptor | None = None,
    **keys: Any,
) -> Result:
    """Return the result of a program with these faults; ``descriptor`` None: of ``robot``."""
    values = {"schema": 1, "program": program, "faults": faults or [], **keys}
    model = Scenario.model_validate(values)
    scenario = ScenarioRun(model, descriptor or robot(), load_backend("sim"))
    for _ in scenario.steps():
        pass
    return scenario.result
