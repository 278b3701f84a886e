"""Services of hand guiding on the node ``robotd``.

After ``~/guide/begin``, ``~/guide/keep`` has to be called at least once in each lease.
``~/guide/end`` returns when the joints are held.
"""

from __future__ import annotations

from typing import Any

from robotd_msgs.srv import BeginGuiding, KeepGuiding
from std_srvs.srv import Trigger

from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service
from robotd_teach.hand_guiding import LEASE_S, MAX_SPEED, TIMEOUT_S, HandGuiding

GUIDE = "~/guide"


def add_guide_services(context: NodeContext, guiding: HandGuiding) -> None:
    """Add the services."""
    node, host = context.operator, context.host

    def begin(request: Any, response: Any) -> str:
        return guiding.begin(
            request.group,
            held=request.held,
            max_speed=request.max_speed or MAX_SPEED,
            timeout_s=request.timeout_s or TIMEOUT_S,
            lease_s=request.lease_s or LEASE_S,
        )

    def keep(request: Any, response: Any) -> str:
        state = guiding.keep()
        response.joints, response.positions = [*state.joints], [*state.joints.values()]
        response.speed, response.left_s = state.speed, state.left_s
        return ""

    def end(request: Any, response: Any) -> str:
        return guiding.end()

    add_service(node, host, BeginGuiding, f"{GUIDE}/begin", begin)
    add_service(node, host, KeepGuiding, f"{GUIDE}/keep", keep, blocking=False)
    add_service(node, host, Trigger, f"{GUIDE}/end", end, urgent=True)
