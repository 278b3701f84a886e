"""Scenarios as a feature: faults of a simulation, at their time or on request."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click
from pydantic import Field

from robotd.api import Capability, MonotonicClock, Unsupported
from robotd.api.commands import FILE
from robotd.api.features import Feature, FeatureOption, File, Section

if TYPE_CHECKING:
    from robotd.api.features import FeatureHost
    from robotd.api.models import RobotDescriptor
    from robotd.api.robots import Backend, Robot
    from robotd_scenario.fault_schedule import FaultSchedule

SIMULATION_NODE = "robotd_sim"
MAX_STEPS = 1_000_000  # periods at once
STEP_TIMEOUT_S = 60.0  # real time


class ScenarioKeys(Section):
    """Keys at the top of a robot's file."""

    scenario: File | None = Field(
        None, description="Simulation: file of the faults that are injected; null: none."
    )


FEATURE = Feature(
    summary="faults of a simulation, from a file or on request",
    settings=ScenarioKeys,
    open="robotd_scenario.feature:open_scenario",
    prepare="robotd_scenario.feature:prepare_robot",
    nodes="robotd_scenario.simulation_node:add_simulation_node",
    node_names=(SIMULATION_NODE,),
    options=(
        FeatureOption(
            "--scenario",
            "scenario",
            "Simulation: inject the faults defined in FILE.",
            "FILE",
            FILE,
        ),
    ),
)


def prepare_robot(descriptor: RobotDescriptor, backend: Backend) -> RobotDescriptor:
    """Return the descriptor with the options of its scenario.

    Raises click.BadParameter: the backend is not simulated; DescriptorError: the file is wrong.
    """
    file = descriptor.settings(ScenarioKeys).scenario
    if file is None:
        return descriptor
    if Capability.SIMULATED not in backend.capabilities:
        text = f"the backend {backend.name} is not simulated"
        raise click.BadParameter(text, param_hint="'--scenario'")
    from robotd_scenario.program import load_scenario

    return load_scenario(file).lay_over(descriptor)


@contextmanager
def open_scenario(host: FeatureHost) -> Iterator[FaultSchedule | None]:
    """Make the fault schedule of a robot whose faults can be injected, or whose time be stepped.

    What it offers as ``faults`` injects them on request: ``RequestedFaults``.
    """
    robot = host.robot
    file, injects = robot.descriptor.settings(ScenarioKeys).scenario, _injects_faults(robot)
    is_stepped = not isinstance(robot.clock, MonotonicClock)  # by the node of the simulation
    if file is None and not injects and not is_stepped:
        yield None
        return
    from robotd_scenario.fault_schedule import FaultSchedule, RequestedFaults
    from robotd_scenario.program import load_scenario

    faults = FaultSchedule(robot, load_scenario(file).faults if file else ())
    if injects:
        host.offered["faults"] = lambda: RequestedFaults(faults)
    host.on_ready.append(faults.begin)
    yield faults


def _injects_faults(robot: Robot) -> bool:
    """Return whether the backend is simulated and can inject faults."""
    try:
        _ = robot.fault_injector
    except Unsupported:
        return False
    return True
