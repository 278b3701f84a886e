"""Requests to a simulation in another process: faults and time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from std_srvs.srv import SetBool, Trigger

from robotd_ros.client.ros_client import RosClient
from robotd_ros.node_registry import WORLD_NODE
from robotd_scenario.feature import SIMULATION_NODE
from robotd_scenario.simulation_node import STEP_TIMEOUT_S


def inject(client: RosClient, fields: Mapping[str, Any]) -> str:
    """Inject a fault; return it as the simulation understood it.

    Args:
        client: started.
        fields: dotted names, like ``{"amp_alarm.axis": 2, "at_s": 1.5}``.

    Raises:
        OperationError: the simulation rejected it; its reason is the text.
        DeviceTimeout: no simulation with a node ``robotd_sim`` answers.
    """
    return client.call_named(f"{SIMULATION_NODE}/inject", fields)


def step(client: RosClient, periods: int) -> str:
    """Run ``periods`` of the control loop, then pause. Raises as ``inject`` does."""
    client.timeout_s += STEP_TIMEOUT_S
    return client.call_named(f"{SIMULATION_NODE}/step", {"periods": periods})


def pause(client: RosClient, *, paused: bool) -> str:
    """Pause or resume simulated time. Raises as ``inject`` does."""
    return str(client.call(SetBool, f"{SIMULATION_NODE}/pause", data=paused).message)


def place(client: RosClient, fields: Mapping[str, Any]) -> str:
    """Move an object of the simulated world; return where it is.

    Args:
        client: started.
        fields: ``name``, and those of x, y, z (m), roll, pitch, yaw (rad) that change.

    Raises:
        OperationError: the simulation rejected it; its reason is the text.
        DeviceTimeout: no robot on a backend with a world answers.
    """
    return client.call_named(f"{WORLD_NODE}/place", fields)


def reset(client: RosClient) -> str:
    """Put all objects back to where they were at the start. Raises as ``place`` does."""
    return str(client.call(Trigger, f"{WORLD_NODE}/reset").message)
