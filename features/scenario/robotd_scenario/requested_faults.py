"""Faults on request, for features that offer them to people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotd.api import Capability, Unsupported
from robotd.api.robots import Robot
from robotd_scenario.fault_kinds import FAULTS, Fault, validate_fault
from robotd_scenario.fault_schedule import FaultSchedule


class RequestedFaults:
    """Faults of one robot on a simulated backend. Any thread.

    Attributes:
        fields: ``name``, ``type``, ``default`` and ``optional`` of each field, by kind of fault.
    """

    def __init__(self, schedule: FaultSchedule) -> None:
        self._schedule = schedule
        definitions = Fault.model_json_schema()["$defs"]
        self.fields: dict[str, list[dict[str, Any]]] = {}
        for kind in FAULTS:
            model = definitions["".join(map(str.capitalize, kind.split("_")))]
            self.fields[kind] = [_field(*each) for each in model["properties"].items()]

    def inject(self, values: Mapping[str, Any]) -> str:
        """Inject a fault, written as in a scenario file; return it as text.

        Raises DescriptorError: it is no fault; InvalidArgument: it does not fit the robot.
        """
        fault = validate_fault(values)
        self._schedule.add(fault)
        return str(fault)


def requested_faults(robot: Robot, schedule: FaultSchedule | None = None) -> RequestedFaults | None:
    """Return the faults of a simulation, by ``schedule`` where there is one; None on hardware."""
    if Capability.SIMULATED not in robot.capabilities:
        return None
    try:
        return RequestedFaults(schedule or FaultSchedule(robot))
    except Unsupported:
        return None


def _field(name: str, spec: Mapping[str, Any]) -> dict[str, Any]:
    types = [spec, *spec.get("anyOf", ())]
    kind = next(each["type"] for each in types if each.get("type"))
    return {
        "name": name,
        "type": kind,
        "default": spec.get("default"),
        "optional": "default" in spec,
    }
