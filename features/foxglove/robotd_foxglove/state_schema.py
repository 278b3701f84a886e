"""JSON schema of ``/robotd/state``: what ``robotd_shared.robot_state.state_of`` returns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

TEXT: Mapping[str, Any] = {"type": "string"}
NUMBER: Mapping[str, Any] = {"type": "number"}
COUNT: Mapping[str, Any] = {"type": "integer"}
FLAG: Mapping[str, Any] = {"type": "boolean"}


def _record(**fields: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": fields, "required": [*fields]}


def _list(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_PROBLEM = _record(
    kind=TEXT, is_fault=FLAG, text=TEXT, axes=_list(TEXT), code=COUNT, remedy=TEXT, since_s=NUMBER
)
_AXIS = _record(
    servo=FLAG,
    offline=FLAG,
    fault=TEXT,
    mode=TEXT,
    operation=TEXT,
    owner=TEXT,
    switches=_list(TEXT),
)
_GOAL = _record(duration_s=NUMBER, joints=_list(TEXT), sender=TEXT, ending=TEXT)
_NODE = _record(
    id=COUNT,
    state=TEXT,
    offline=FLAG,
    error_code=COUNT,
    axes=COUNT,
    inputs=COUNT,
    outputs=COUNT,
    fault=TEXT,
)
_BUS = _record(
    name=TEXT,
    state=TEXT,
    lost_frames=COUNT,
    timeouts=COUNT,
    late_cycles=COUNT,
    note=TEXT,
    details={"type": "object"},
    nodes=_list(_NODE),
)

STATE_SCHEMA = {
    "title": "robotd.State",
    **_record(
        type=TEXT,
        device=TEXT,
        ready=FLAG,
        problems=_list(_PROBLEM),
        speed=NUMBER,
        paused=FLAG,
        axes=_list(_AXIS),
        # null where a group of joints follows no goal.
        goals=_list({"oneOf": [_GOAL, {"type": "null"}]}),
        inputs=TEXT,
        outputs=TEXT,
        buses=_list(_BUS),
        missed=COUNT,
        viewers=COUNT,
    ),
}
