"""ROS arguments given at start: unknown parameters are errors.

Nodes keep their names: parameters of descriptors and the commands of robotd find them by name.

Works around: rclpy ignores an override that no node declares, so that a misspelled limit has no
effect. rcl before 9.2.8 remaps (``-r``) nodes, topics and services; an action's own services and
topics have other names (``NAME/_action/send_goal``), so that a rule for the action matches none of
them: ``Parameters.action`` resolves the name before the action is made.
Measured: nothing; once at start.
Upstream: by design (https://github.com/ros2/rclcpp/pull/1751 documents it); for actions
https://github.com/ros2/ros2/issues/1312, done by
https://github.com/ros2/rcl/pull/1170.
Ends with: rcl 9.2.8 of Jazzy, for actions; no version for the parameters, it is by design.
Shown by: tests/ros/test_unknown_parameters.py, tests/ros/test_middleware.py.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from rclpy.node import Node

from robotd.errors import DescriptorError, did_you_mean
from robotd.log import get_logger

log = get_logger("ros")

_ROS_PREFIX = "qos_overrides."  # declared by rclpy only where a QoS can be overridden
_SECTION = "ros__parameters"
_PARAMETER_OPTIONS = ("-p", "--param")
_FILE_OPTION = "--params-file"
_REMAP_OPTIONS = ("-r", "--remap")
_NODE_NAME = ("__node", "__name")

# Nodes of wmx_ros2_package 0.1.0 and later → the node that has their parameters here.
RENAMED = {
    "joint_state_broadcaster": "manipulator_state",
    "joint_trajectory_controller": "follow_joint_trajectory_server",
    "gripper_controller": "follow_joint_trajectory_server",
}


def check_remapping(
    names: Collection[str], known: Collection[str], ros_args: Sequence[str]
) -> list[str]:
    """Return ``ros_args`` without rules that rename a node to a name of this process.

    ``Node(name=...)`` of launch adds such a rule, which would give all nodes this name.

    Args:
        names: of the nodes of the process.
        known: names of all nodes that robotd or a plugin could serve.
        ros_args: command line from ``--ros-args`` on.

    Raises DescriptorError: a rule renames nodes, or is for a node that does not exist.
    """
    kept: list[str] = []
    errors = []
    for word in ros_args:
        is_rule = bool(kept) and kept[-1] in _REMAP_OPTIONS
        source, _, target = word.partition(":=") if is_rule else ("", "", "")
        node, _, what = source.rpartition(":")
        if what in _NODE_NAME and target in names and node in ("", target):
            kept.pop()
            continue
        kept.append(word)
        if what in _NODE_NAME and (not node or node in known):
            reason = (
                "nodes keep their names, by which parameters and the commands of robotd find them:"
                " a namespace (-r __ns:=/NAME) tells robots apart; in a launch file leave out name="
            )
            errors.append(DescriptorError(reason, key=word))
        elif node and node not in known and (hint := did_you_mean(node, [*known])):
            errors.append(DescriptorError(f"no node of robotd has this name{hint}", key=word))
    if errors:
        raise DescriptorError.join(errors)
    return kept


def check_overrides(
    nodes: Sequence[Node], own: Collection[str], known: Collection[str], ros_args: Sequence[str]
) -> None:
    """Reject parameters that no node has; warn of sections that match no node.

    A name given for all nodes (``-p NAME:=VALUE``, ``/**`` in a file) need be known to one of
    them. A plugin's node may declare parameters later: there an unknown name is a warning.

    Args:
        nodes: all nodes of the process, their parameters declared.
        own: names of the nodes that robotd itself brings.
        known: names of all nodes that robotd or a plugin could serve.
        ros_args: command line from ``--ros-args`` on.

    Raises DescriptorError: the unknown parameters, or an unknown node of ``-p NODE:NAME:=VALUE``.
    """
    accepted = {name for node in nodes for name in overrides_of(node) if node.has_parameter(name)}
    unknown: dict[str, list[tuple[str, DescriptorError]]] = {}  # hints and errors by parameter
    for node in nodes:
        for name in overrides_of(node):
            if name in accepted or name.startswith(_ROS_PREFIX):
                continue
            hint = did_you_mean(name, [*node.get_parameters_by_prefix("")])
            error = DescriptorError(
                f"the node has no such parameter{hint}", key=f"{node.get_name()}.{name}"
            )
            if node.get_name() in own:
                unknown.setdefault(name, []).append((hint, error))
            else:
                log.warning("parameter not declared at start", reason=str(error))
    errors = []
    for name, found in unknown.items():
        hinted = [error for hint, error in found if hint]
        if len(found) > 1 and not hinted:  # given for all nodes
            errors.append(DescriptorError("no node has such a parameter", key=name))
        errors += hinted or [error for _, error in found if len(found) == 1]
    errors += _check_sections(nodes, known, ros_args)
    if errors:
        raise DescriptorError.join(errors)


def overrides_of(node: Node) -> Mapping[str, Any]:
    """Return the parameters that the command line and files give a node, by name.

    rclpy hides them. Where it has another place for them there are none, which is logged once:
    unknown parameters are ignored then, as by other nodes, and errors name no value.
    """
    overrides: Mapping[str, Any] | None = getattr(node, "_parameter_overrides", None)
    return _hidden_overrides() if overrides is None else overrides


@cache
def _hidden_overrides() -> Mapping[str, Any]:
    log.warning("unknown parameters are ignored by plain rclpy: it has other internals")
    return {}


def _check_sections(
    nodes: Sequence[Node], known: Collection[str], ros_args: Sequence[str]
) -> Iterator[DescriptorError]:
    """Compare the node names of parameters with the nodes; yields errors, logs warnings."""
    full_names = [node.get_fully_qualified_name() for node in nodes]
    for source, section in _sections(ros_args):
        if any(_pattern(section).fullmatch(name) for name in full_names):
            continue
        name = section.rpartition("/")[2]
        same = [full_name for full_name in full_names if full_name.rpartition("/")[2] == name]
        if same:
            reason = f"the node is {same[0]}; /**/{name} matches it in any namespace"
        elif name in known:
            continue  # of a deployment that starts it elsewhere
        elif name in RENAMED:
            reason = f"the node is called {RENAMED[name]} here (robotd docs how-to/migrate)"
        elif hint := did_you_mean(name, [*known]):
            reason = f"no node of robotd has this name{hint}"
            if source in _PARAMETER_OPTIONS:
                yield DescriptorError(reason, key=section)
                continue
        else:
            continue  # of another program
        log.warning("parameters have no effect", node=section, source=source, reason=reason)


def _sections(ros_args: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield option or file of each section of parameters, and its node name or pattern."""
    for option, value in itertools.pairwise(ros_args):
        if option in _PARAMETER_OPTIONS:
            node, colon, _ = value.partition(":=")[0].rpartition(":")
            if colon:
                yield option, node if node.startswith("/") else f"/{node}"
        elif option == _FILE_OPTION:
            for section in dict.fromkeys(_sections_of(_content(Path(value)))):
                yield value, section


def _content(path: Path) -> Any:
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError):
        return None  # rclpy has said what is wrong with it


def _sections_of(content: Any, prefix: str = "") -> Iterable[str]:
    """Full names or patterns of the nodes in a parameter file; namespaces may be nested."""
    if isinstance(content, dict):
        for key, value in content.items():
            if key == _SECTION:
                yield prefix
            else:
                yield from _sections_of(value, f"{prefix}/{str(key).strip('/')}")


def _pattern(section: str) -> re.Pattern[str]:
    """Return the regular expression of a node name: ``*`` one part, ``**`` any number."""
    parts = {"*": "/[^/]+", "**": "(/[^/]+)*"}
    return re.compile("".join(parts.get(p) or f"/{re.escape(p)}" for p in section[1:].split("/")))
