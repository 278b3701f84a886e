"""Services of hand guiding on the node ``robotd``.

``~/guide/begin`` takes ``group``, ``max_speed``, ``timeout_s`` and ``lease_s``, each of them only
where it is wanted (SetParametersAtomically). ``~/guide/keep`` (Trigger) has to be called at least
once in each lease, by default 1 s; its answer is JSON with the fields of ``GuidingState``, or why
guiding has ended. ``~/guide/end`` (Trigger) returns when the joints are held.
"""

from __future__ import annotations

import json
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from std_srvs.srv import Trigger

from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service, named_values
from robotd_teach.hand_guiding import LEASE_S, HandGuiding
from robotd_teach.request_values import taken

GUIDE = "~/guide"


def add_guide_services(context: NodeContext, guiding: HandGuiding) -> None:
    """Add the services."""
    node, host = context.operator, context.host

    def begin(values: dict[str, Any]) -> str:
        possible = {"group": str, "max_speed": float, "timeout_s": float, "lease_s": float}
        return guiding.begin(**{"lease_s": LEASE_S, **taken(values, {}, possible)})

    def keep(request: Any, response: Any) -> str:
        return json.dumps(guiding.keep()._asdict())

    def end(request: Any, response: Any) -> str:
        return guiding.end()

    add_service(node, host, SetParametersAtomically, f"{GUIDE}/begin", named_values(begin))
    add_service(node, host, Trigger, f"{GUIDE}/keep", keep, blocking=False)
    add_service(node, host, Trigger, f"{GUIDE}/end", end, urgent=True)
