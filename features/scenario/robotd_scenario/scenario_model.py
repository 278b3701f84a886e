"""Model and loader of scenario files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from robotd.api.models import RobotDescriptor, beside, read_yaml, validate
from robotd_scenario.fault_kinds import Fault, Part
from robotd_scenario.program import Step


class Scenario(Part):
    """Faults, commands and checks for one robot.

    Attributes:
        robot: a name, or a path relative to the file; None takes it from elsewhere.
        options: laid over the backend's section of the descriptor (``seed``, noise ...).
        faults: injected faults; times count from the moment that the robot is ready.
        program: commands and checks; used by ``robotd sim run`` only.
    """

    schema_: Literal[1] = Field(alias="schema")
    summary: str = ""
    robot: str | None = None
    variant: str | None = None
    backend: str = "sim"
    options: dict[str, Any] = Field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    program: tuple[Step, ...] = ()

    def lay_over(self, descriptor: RobotDescriptor) -> RobotDescriptor:
        """Return ``descriptor`` with the options of this scenario."""
        if not self.options:
            return descriptor
        section = {**descriptor.backends.get(self.backend, {}), **self.options}
        backends = {**descriptor.backends, self.backend: section}
        return descriptor.model_copy(update={"backends": backends})


def load_scenario(path: Path) -> Scenario:
    """Read and check a file. Raises DescriptorError with every error and its line."""
    tree = read_yaml(path)
    scenario = validate(Scenario, tree.plain(), tree)
    robot = scenario.robot
    if robot is None or not (robot.endswith(".yaml") or "/" in robot):
        return scenario
    return scenario.model_copy(update={"robot": str(beside(path, robot))})
