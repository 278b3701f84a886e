"""The ``ros-node`` directive: topics, services, actions and parameters of a running node.

The robots that come with robotd are run on the simulation and asked over ROS. The body of the
directive is a definition list with the meaning of each topic and service; a name without a
meaning, and a meaning without a name, are errors. With ``:like: NODE`` topics and services that
the body leaves out have the meanings of those with the same last word there.
"""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from robotd_docs.markdown import code, definitions
from robotd_doctor.model_tables import table

log = logging.getLogger(__name__)
DOCUMENTED: set[str] = set()
MEANINGS: dict[str, dict[str, str]] = {}  # by node, then by the last word of a name
TIMEOUT_S = 180.0


@cache
def nodes_of_all_robots() -> dict[str, Any]:
    """Return what the nodes offer, by name of the node. Runs the robots the first time."""
    script = Path(__file__).with_name("ask_nodes.py")
    command = [sys.executable, str(script)]
    done = subprocess.run(  # noqa: S603 - our own script
        command, check=True, capture_output=True, text=True, timeout=TIMEOUT_S
    )
    surface: dict[str, Any] = json.loads(done.stdout)
    return surface


class RosNodeDirective(SphinxDirective):
    """Render the tables of the node whose name is the argument."""

    required_arguments = 1
    has_content = True
    option_spec: ClassVar = {"like": directives.unchanged_required}

    def run(self) -> list[nodes.Node]:
        """Return one table for each kind of thing that the node offers."""
        name = self.arguments[0]
        node = nodes_of_all_robots().get(name)
        if node is None:
            raise self.error(f"no robot runs a node named {name!r}")
        DOCUMENTED.add(name)
        meanings = definitions(self.content)
        like = self.options.get("like")
        if like and like not in MEANINGS:
            raise self.error(f"{like!r} is not described before {name}")
        shared = MEANINGS.get(like, {})
        MEANINGS[name] = shared | {last_word(key): text for key, text in meanings.items()}
        used: set[str] = set()
        parts = [self._entities(node, kind, meanings, shared, used) for kind in KINDS]
        parts.append(self._parameters(node, meanings, used))
        if unknown := sorted(set(meanings) - used):
            raise self.error(f"{name} has no {', '.join(unknown)}")
        return self.parse_text_to_nodes("\n\n".join(filter(None, parts)))

    def _entities(
        self,
        node: Any,
        kind: str,
        meanings: dict[str, str],
        shared: dict[str, str],
        used: set[str],
    ) -> str:
        rows = []
        for entity in node[kind]:
            key = entity["parameter"] or entity["name"].removeprefix("/")
            meaning = meanings.get(key, shared.get(last_word(key)))
            if meaning is None:
                raise self.error(f"{entity['name']} ({kind}) has no meaning: add `{key}`")
            used.add(key)
            names = [entity["parameter"], entity["name"]] if entity["parameter"] else [key]
            cell = " ".join(map(code, [*names, entity["type"]]))
            rows.append((cell, entity["qos"], meaning))
        return table((KINDS[kind], "QoS", "meaning"), rows) if rows else ""

    def _parameters(self, node: Any, meanings: dict[str, str], used: set[str]) -> str:
        rows = []
        for parameter in node["parameters"]:
            name = parameter["name"]
            meaning = parameter["description"]
            if name in meanings and name not in used:
                used.add(name)
                meaning = f"{meaning}. {meanings[name]}"
            values = [
                f"{code(value)} ({robots})" if robots else code(value)
                for value, robots in parameter["values"]
            ]
            cell = f"{code(name)} {code(parameter['type'])}"
            rows.append((cell, ", ".join(values), meaning))
        return table(("parameter", "value", "meaning"), rows) if rows else ""


def last_word(name: str) -> str:
    """Return ``set_pose`` of ``diff_drive_controller/set_pose``."""
    return name.rpartition("/")[2]


KINDS = {
    "services": "service",
    "subscribed": "subscribed topic",
    "published": "published topic",
    "actions": "action",
}


def check_all_documented(app: Any, env: Any) -> None:
    """Warn about nodes without a ``ros-node`` directive."""
    for name in sorted(set(nodes_of_all_robots()) - DOCUMENTED):
        log.warning("node %r is on no page: add a {ros-node} directive", name)


def setup(app: Any) -> None:
    """Register the directive and the completeness check."""
    app.add_directive("ros-node", RosNodeDirective)
    app.connect("env-check-consistency", check_all_documented)
