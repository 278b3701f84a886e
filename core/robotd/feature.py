"""Features: parts that run beside a robot, of this repository and of others alike.

A feature is an object in the entry-point group ``robotd.features``:
``recorder = "robotd_recorder.feature:FEATURE"``. It has keys in the robot's file, options of
``robotd run`` that set them, and a function that runs it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from graphlib import CycleError, TopologicalSorter
from typing import Any

from pydantic import BaseModel

from robotd.entry_points import entry_points
from robotd.errors import plugin_failure

FEATURES = "robotd.features"


@dataclass(frozen=True)
class FeatureOption:
    """Option of ``robotd run``, short for ``--set KEY=VALUE``.

    Attributes:
        flag: as click takes it: ``--page``, or ``--page-control/--no-page-control``.
        key: key of the robot's file, dotted.
        help: one sentence.
        metavar: name of the value in the help; "" for a flag without one.
        type: type of click that parses the value; None for a flag without one.
        omitted: value of the option where none is given with it; None: one has to be.
    """

    flag: str
    key: str
    help: str
    metavar: str = ""
    type: Any = None
    omitted: Any = None


@dataclass(frozen=True)
class Feature:
    """Part that runs beside a robot.

    Attributes:
        summary: one line for ``robotd features``.
        settings: model whose fields are keys at the top level of the robot's file, all with a
            default; ``robot.descriptor.settings(model)`` returns its values.
        options: of ``robotd run``.
        open: ``package.module:function``, called as ``function(host: FeatureHost)`` before the
            robot starts. It returns a context manager that is left after the robot has shut down;
            its value is the running part, None where the robot does not want it.
        prepare: ``package.module:function``, called as ``function(descriptor, backend)`` before
            the robot is made; it returns the descriptor to be used. "": none.
        nodes: ``package.module:function``, called as ``function(context: NodeContext, part)``
            where ROS nodes run and the part is not None. It returns a context manager, whose value
            is a list of further nodes or None. "": none.
        node_names: names of the nodes that ``nodes`` may add.
        after: names of features that are opened before this one, as far as they are installed.
        attributes: attributes of ``Robot`` by name: ``package.module:function``, called as
            ``function(robot)`` when the attribute is first read. They need no ``open``.
    """

    summary: str
    settings: type[BaseModel]
    open: str
    options: tuple[FeatureOption, ...] = ()
    prepare: str = ""
    nodes: str = ""
    node_names: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    attributes: Mapping[str, str] = field(default_factory=dict)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the robot's file that belong to it."""
        return tuple(self.settings.model_fields)


@cache
def installed_features() -> dict[str, Feature]:
    """Return the features by name, in the order in which they are opened. Any thread.

    One of ``feature_failures`` is left out: its keys and options are unknown.
    """
    found = {name: each for name, each in sorted(_loaded().items()) if isinstance(each, Feature)}
    order = TopologicalSorter({name: found.keys() & {*each.after} for name, each in found.items()})
    try:
        return {name: found[name] for name in order.static_order()}
    except CycleError:  # no order suits them all
        return found


def feature_failures() -> dict[str, str]:
    """Return why features cannot be used, by their names. Any thread."""
    return {name: each for name, each in _loaded().items() if isinstance(each, str)}


@cache
def _loaded() -> dict[str, Feature | str]:
    """Return each feature, or why it cannot be used."""
    loaded: dict[str, Feature | str] = {}
    keys: dict[str, str] = {}
    found = entry_points(group=FEATURES)
    for entry in sorted(found, key=lambda entry: not (entry.dist and entry.dist.name == "robotd")):
        try:
            feature = entry.load()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - of a third party
            loaded[entry.name] = f"cannot be imported: {plugin_failure(error, entry.value)}"
            continue
        if not isinstance(feature, Feature):
            loaded[entry.name] = f"{entry.value} is no Feature"
        elif taken := [key for key in feature.keys if keys.get(key, entry.name) != entry.name]:
            loaded[entry.name] = f"its key {taken[0]!r} belongs to the feature {keys[taken[0]]!r}"
        else:
            keys |= dict.fromkeys(feature.keys, entry.name)
            loaded[entry.name] = feature
    return loaded
