"""Loads a robot's descriptor by name or file and reports every error at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from robotd.descriptor.files import beside, is_file
from robotd.descriptor.inheritance import extended, overlaid, variants_of
from robotd.descriptor.model import RobotDescriptor
from robotd.descriptor.overrides import Override, overridden
from robotd.descriptor.search_path import find_robot, robots_in
from robotd.descriptor.validation_errors import Model, join, problems_of, validate
from robotd.descriptor.yaml_tree import YamlNode
from robotd.errors import DescriptorError, PluginError, unknown_name
from robotd.feature import feature_errors, installed_features

_FILE_KEYS = ("parameters_file", "urdf")


@dataclass(frozen=True)
class RobotSummary:
    """A robot of the search path.

    Attributes:
        name: value of ``--robot``: the name of the robot's folder.
        summary: one line from the file.
        variants: names of its variants, the default one first.
        path: its file.
        problem: why it cannot be used; None for a valid one.
    """

    name: str
    summary: str
    variants: tuple[str, ...]
    path: Path
    problem: str | None = None


def list_robots(search_path: Sequence[Path] | None = None) -> tuple[RobotSummary, ...]:
    """Return every robot of the search path by name, invalid ones included. Never raises."""
    return tuple(_summarise(name, path, search_path) for name, path in robots_in(search_path))


def load_robot_descriptor(
    robot: str | Path,
    variant: str | None = None,
    search_path: Sequence[Path] | None = None,
    overrides: Sequence[Override] = (),
) -> RobotDescriptor:
    """Load a robot by name, or by the path of its file or folder.

    Args:
        robot: a name of the search path, or a path (a ``Path``, or text with a separator or the
            ending .yaml).
        variant: name of a variant; None means the file's ``default_variant``.
        search_path: folders that hold ``<name>/robot.yaml``; None: ``default_search_path()``.
        overrides: values that replace those of the file and its variant, see ``parse_override``.

    Raises:
        DescriptorError: the robot or its variant is not known, or the file is wrong. All
            variants are checked, so that one deployment cannot break another unseen.
        PluginError: the kind of its base cannot be used.
    """
    tree = extended(find_robot(robot, search_path), (), search_path)
    names, default = variants_of(tree)
    if variant is not None and variant not in names:
        raise DescriptorError(
            unknown_name("variant", variant, names), path=tree.path, key="variants"
        )
    problems: list[DescriptorError] = []
    robots = {
        name: _check(tree, name, overrides, problems)
        for name in (*names, *([] if default else [None]))
    }
    robot_or_none = robots[variant or default]
    if problems or robot_or_none is None:
        raise join(problems)
    return robot_or_none


def validate_section(descriptor: RobotDescriptor, section: str, model: type[Model]) -> Model:
    """Validate a free mapping such as ``backends.sim`` by the model of a plugin.

    A missing section is validated as an empty one. Raises DescriptorError in the format of every
    other error of the file.
    """
    keys = section.split(".")
    values: Any = getattr(descriptor, keys[0])
    for key in keys[1:]:
        values = values.get(key) or {}
    return validate(model, values, descriptor.tree, keys)


def _check(
    tree: YamlNode,
    variant: str | None,
    overrides: Sequence[Override],
    problems: list[DescriptorError],
) -> RobotDescriptor | None:
    """Return the descriptor of one variant; None after adding to ``problems``."""
    before = len(problems)
    tree = overlaid(tree, variant, problems)
    tree = overridden(tree, overrides)
    tree = _with_files(tree, problems)
    settings, own = _feature_settings(tree, problems)
    try:
        descriptor = RobotDescriptor.model_validate(own).of(tree, variant, settings)
    except ValidationError as error:
        problems.extend(problems_of(RobotDescriptor, error, tree, ()))
        return None
    return descriptor if len(problems) == before else None


def _feature_settings(
    tree: YamlNode, problems: list[DescriptorError]
) -> tuple[dict[type[BaseModel], BaseModel], dict[str, Any]]:
    """Return the settings of features by their models, and the other keys."""
    settings: dict[type[BaseModel], BaseModel] = {}
    own = tree.plain()
    for name, feature in installed_features().items():
        values = {key: own.pop(key) for key in feature.keys if key in own}
        try:
            with feature_errors(name, "settings", unchanged=(ValidationError,)):
                settings[feature.settings] = feature.settings.model_validate(values)
        except ValidationError as error:
            problems.extend(problems_of(feature.settings, error, tree, ()))
    return settings, own


def _with_files(tree: YamlNode, problems: list[DescriptorError]) -> YamlNode:
    """Return ``tree`` with absolute file paths, each resolved beside the file that names it."""
    children = dict(tree.value)
    for key in _FILE_KEYS:
        node = children.get(key)
        if node is None or not isinstance(node.value, str):
            continue  # absent or null; anything else is found by the model
        path = beside(node.path, node.value)
        if not is_file(path):
            what = f"file {str(path)!r} does not exist"
            problems.append(DescriptorError(what, path=node.path, line=node.line, key=key))
        children[key] = replace(node, value=path)
    return replace(tree, value=children)


def _summarise(name: str, path: Path, search_path: Sequence[Path] | None) -> RobotSummary:
    try:
        robot = load_robot_descriptor(path, search_path=search_path)
    except (DescriptorError, PluginError) as error:  # the latter of a kind of base
        return RobotSummary(name, "", (), path, str(error))
    default = robot.default_variant
    variants = sorted(robot.variants, key=lambda variant: variant != default)
    return RobotSummary(name, robot.summary, tuple(variants), path)
