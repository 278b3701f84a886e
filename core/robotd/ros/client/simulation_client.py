"""Client of a simulation in another process: faults and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from std_srvs.srv import SetBool

from robotd.ros.client.ros_client import RosClient
from robotd.ros.node_registry import SIMULATION_NODE
from robotd.ros.nodes.simulation_node import STEP_TIMEOUT_S


def inject(ros_args: Sequence[str], timeout_s: float, fields: Mapping[str, Any]) -> str:
    """Inject a fault; return it as the simulation understood it.

    Args:
        ros_args, timeout_s: as for ``RosClient``.
        fields: dotted names, like ``{"amp_alarm.axis": 2, "at_s": 1.5}``.

    Raises:
        OperationError: the simulation rejected it; its reason is the text.
        DeviceTimeout: no simulation with a node ``robotd_sim`` answers.
    """
    return _ask(ros_args, timeout_s, "inject", fields)


def step(ros_args: Sequence[str], timeout_s: float, periods: int) -> str:
    """Run ``periods`` of the control loop, then pause. Raises as ``inject`` does."""
    return _ask(ros_args, timeout_s + STEP_TIMEOUT_S, "step", {"periods": periods})


def pause(ros_args: Sequence[str], timeout_s: float, *, paused: bool) -> str:
    """Pause or resume simulated time. Raises as ``inject`` does."""
    with RosClient(ros_args, timeout_s) as client:
        return str(client.call(SetBool, f"{SIMULATION_NODE}/pause", data=paused).message)


def _ask(ros_args: Sequence[str], timeout_s: float, service: str, fields: Mapping[str, Any]) -> str:
    with RosClient(ros_args, timeout_s) as client:
        return client.call_named(f"{SIMULATION_NODE}/{service}", fields)
