"""Loads a robot's descriptor by name or file and reports every error at once."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from robotd.descriptor.files import beside, is_file, is_folder
from robotd.descriptor.model import RobotDescriptor
from robotd.descriptor.overrides import FIXED_KEYS, Override, overridden
from robotd.descriptor.problems import Model, join, problems_of, validate
from robotd.descriptor.source import YamlNode, merge, read_yaml
from robotd.errors import DescriptorError, PluginError, unknown_name
from robotd.feature import feature_errors, installed_features

FILE_NAME = "robot.yaml"
URDF_SUFFIXES = (".urdf", ".xacro")
MAX_EXTENDS = 8
MAX_VARIANTS = 32  # each is checked, whichever is asked for

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


def default_search_path() -> tuple[Path, ...]:
    """Return the folder of the robots that robotd ships; empty where not installed."""
    spec = find_spec("robotd_robots")
    return tuple(Path(folder) for folder in (spec and spec.submodule_search_locations) or ())


def list_robots(search_path: Sequence[Path] | None = None) -> tuple[RobotSummary, ...]:
    """Return every robot of the search path by name, invalid ones included. Never raises."""
    return tuple(_summarise(name, path, search_path) for name, path in _robots(search_path))


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
    tree = _extended(_find(robot, search_path), (), search_path)
    names, default = _variants(tree)
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


def _variants(tree: YamlNode) -> tuple[list[str], str | None]:
    """Return the variants' names and the default one; the model checks the rest.

    Raises DescriptorError: more than ``MAX_VARIANTS``.
    """
    variants = tree.value.get("variants")
    names = list(variants.value) if variants and isinstance(variants.value, dict) else []
    if variants and len(names) > MAX_VARIANTS:
        what = f"{len(names)} variants, the limit is {MAX_VARIANTS}"
        raise DescriptorError(what, path=variants.path, line=variants.line, key="variants")
    default = tree.value.get("default_variant")
    return names, default.value if default and default.value in names else None


def _check(
    tree: YamlNode,
    variant: str | None,
    overrides: Sequence[Override],
    problems: list[DescriptorError],
) -> RobotDescriptor | None:
    """Return the descriptor of one variant; None after adding to ``problems``."""
    before = len(problems)
    tree = _overlaid(tree, variant, problems)
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


def _overlaid(tree: YamlNode, variant: str | None, problems: list[DescriptorError]) -> YamlNode:
    overlay = tree.find(["variants", variant]) if variant is not None else None
    if overlay is None or not isinstance(overlay.value, dict):
        return tree  # a variant that is no mapping is found by the model
    for key in FIXED_KEYS:
        if key in overlay.value:
            node = overlay.value[key]
            where = f"variants.{variant}.{key}"
            what = "a variant cannot change this"
            problems.append(DescriptorError(what, path=node.path, line=node.line, key=where))
    allowed = {key: node for key, node in overlay.value.items() if key not in FIXED_KEYS}
    merged = merge(tree, replace(overlay, value=allowed))
    return replace(merged, path=tree.path, line=tree.line)


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


def _extended(path: Path, above: tuple[Path, ...], search_path: Sequence[Path] | None) -> YamlNode:
    """Return the tree of ``path``, merged over the one that it extends."""
    tree = read_yaml(path)
    node = tree.value.pop("extends", None)
    if node is None:
        return tree
    if not isinstance(node.value, str):
        what = "must be the name of a robot, or a path"
        raise DescriptorError(what, path=path, line=node.line, key="extends")
    chain = (*above, path.absolute())
    base = _base(path, node, search_path)
    if base in chain or len(chain) >= MAX_EXTENDS:
        what = " → ".join(str(link) for link in (*chain, base))
        raise DescriptorError(
            f"extends itself or is too deep: {what}", path=path, line=node.line, key="extends"
        )
    if not is_file(base):
        what = f"file {str(base)!r} does not exist"
        raise DescriptorError(what, path=path, line=node.line, key="extends")
    merged = merge(_extended(base, chain, search_path), tree)
    return replace(merged, path=path)


def _base(path: Path, node: YamlNode, search_path: Sequence[Path] | None) -> Path:
    """Return the file that ``path`` extends, by path or by name of a robot."""
    if os.sep in node.value or node.value.endswith(".yaml"):
        return beside(path, node.value)
    try:
        return _find(node.value, search_path)
    except DescriptorError as error:
        raise DescriptorError(str(error), path=path, line=node.line, key="extends") from None


def _find(robot: str | Path, search_path: Sequence[Path] | None) -> Path:
    path = Path(robot)
    if path.suffix in URDF_SUFFIXES:
        what = f"{robot} has no drives and limits of a robot: robotd new-robot NAME --urdf {robot}"
        raise DescriptorError(f"{what} makes a robot of it")
    if isinstance(robot, Path) or os.sep in robot or robot.endswith(".yaml"):
        return path / FILE_NAME if is_folder(path) else path
    robots = list(_robots(search_path))
    found = [path for name, path in robots if name == robot]
    if len(found) == 1:
        return found[0]
    if found:
        raise DescriptorError(f"robot {robot!r} exists twice: {found[0]} and {found[1]}")
    what = unknown_name("robot", robot, sorted({name for name, _ in robots}))
    if is_file(Path(robot) / FILE_NAME):
        what += f"; the folder is named by its file: {Path(robot) / FILE_NAME}"
    raise DescriptorError(what)


def _robots(search_path: Sequence[Path] | None) -> Iterator[tuple[str, Path]]:
    for folder in default_search_path() if search_path is None else search_path:
        for path in sorted(folder.glob(f"*/{FILE_NAME}")):
            yield path.parent.name, path


def _summarise(name: str, path: Path, search_path: Sequence[Path] | None) -> RobotSummary:
    try:
        robot = load_robot_descriptor(path, search_path=search_path)
    except (DescriptorError, PluginError) as error:  # the latter of a kind of base
        return RobotSummary(name, "", (), path, str(error))
    default = robot.default_variant
    variants = sorted(robot.variants, key=lambda variant: variant != default)
    return RobotSummary(name, robot.summary, tuple(variants), path)
