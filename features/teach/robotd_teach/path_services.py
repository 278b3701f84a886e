"""Services and topic of the paths on the node ``robotd``.

``~/paths`` has all paths as JSON by name, with the fields of ``PathState``. The services take
values by name (SetParametersAtomically): ``~/paths/begin`` ``name``, ``group`` and ``replace``;
``~/paths/rename`` ``name`` and ``new``; ``~/paths/delete`` ``name``; ``~/paths/plan`` ``name``,
``speed``, ``timing``, ``reverse``, ``from`` and ``approach``, whose answer is JSON: the points of a
goal that begins where the arm is, and a ``text`` about it. ``~/paths/keep`` and ``~/paths/end``
(Trigger) answer the state of the recording under way, with the fields of ``RecordingState``, and
end it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rcl_interfaces.srv import SetParametersAtomically
from std_msgs.msg import String
from std_srvs.srv import Trigger

from robotd.api import InvalidArgument
from robotd_ros.nodes.latched_topics import publish_if_alive
from robotd_ros.qos import LATCHED
from robotd_ros.run_nodes import NodeContext
from robotd_ros.services import add_service, named_values
from robotd_teach.path_motion import PathTiming
from robotd_teach.paths import PathPlan, Paths, Playback
from robotd_teach.request_values import taken

PATHS = "~/paths"
DECIMALS = 7  # of the points of a goal
PLAYBACK = {"speed": float, "timing": str, "reverse": bool, "from": float}


@contextmanager
def add_path_services(context: NodeContext, paths: Paths) -> Iterator[None]:
    """Add services and topic."""
    node, host = context.operator, context.host
    topic = node.create_publisher(String, PATHS, LATCHED)

    def publish() -> None:
        told = {name: state._asdict() for name, state in paths.all().items()}
        publish_if_alive(topic, String(data=json.dumps(told)))

    def begin(values: dict[str, Any]) -> str:
        given = taken(values, {"name": str}, {"group": str, "replace": bool})
        return paths.begin(given.pop("name"), given.pop("group", ""), **given)

    def rename(values: dict[str, Any]) -> str:
        given = taken(values, {"name": str, "new": str}, {})
        paths.rename(given["name"], given["new"])
        return f"{given['name']} is called {given['new']} now"

    def delete(values: dict[str, Any]) -> str:
        name = taken(values, {"name": str}, {})["name"]
        paths.delete(name)
        return f"{name} is deleted"

    def plan(values: dict[str, Any]) -> str:
        given = taken(values, {"name": str}, {**PLAYBACK, "approach": bool})
        name, approach = given.pop("name"), given.pop("approach", False)
        return _points(paths.plan(name, _playback(given), approach=approach))

    services: Mapping[str, Callable[[dict[str, Any]], str]] = {
        "begin": begin, "rename": rename, "delete": delete, "plan": plan
    }  # fmt: skip
    for name, handle in services.items():
        add_service(node, host, SetParametersAtomically, f"{PATHS}/{name}", named_values(handle))

    def keep(request: Any, response: Any) -> str:
        return json.dumps(paths.recording_state()._asdict())

    def end(request: Any, response: Any) -> str:
        return paths.end()

    add_service(node, host, Trigger, f"{PATHS}/keep", keep, blocking=False)
    add_service(node, host, Trigger, f"{PATHS}/end", end)
    paths.on_change = publish
    publish()
    yield


def _playback(given: dict[str, Any]) -> Playback:
    """Return how a path is played. Raises InvalidArgument."""
    timings = [timing.value for timing in PathTiming]
    if (timing := given.get("timing", timings[0])) not in timings:
        raise InvalidArgument(f"timing is {timing!r}, must be {' or '.join(timings)}")
    return Playback(
        given.get("speed"),
        PathTiming(timing),
        given.get("reverse", False),
        given.get("from", 0.0),
    )


def _points(plan: PathPlan) -> str:
    motion = plan.motion.motion
    return json.dumps(
        {
            "text": plan.text,
            "joints": plan.group.joint_names,
            "times_s": motion.times_s.round(9).tolist(),
            "positions": motion.positions.round(DECIMALS).tolist(),
            "velocities": motion.velocities.round(DECIMALS).tolist(),
            "parts": plan.motion.parts.round(4).tolist(),
        }
    )
