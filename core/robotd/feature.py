"""Features: parts that run alongside a robot, of this repository and of others alike.

A feature is an object in the entry-point group ``robotd.features``:
``recorder = "robotd_recorder.feature:FEATURE"``. It has keys in the robot's file, options of
``robotd run`` that set them, and a function that runs it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import field
from functools import lru_cache, reduce
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import EntryPoint
from typing import Annotated, Any, NamedTuple, Self

import click
from pydantic import BaseModel, Field, field_validator, model_validator
from pydantic.dataclasses import dataclass

from robotd.entry_points import (
    OWNER,
    PluginOrigin,
    installed_names,
    load_entry,
    plugin_errors,
    rivals,
)
from robotd.errors import PluginError, did_you_mean, plugin_failure

FEATURES = "robotd.features"
RUN_OPTIONS = (
    *("--backend", "--help", "--log-format", "--log-level", "--namespace", "--nodes", "--rate"),
    *("--report", "--robot", "--ros-args", "--set", "--time-scale", "--variant", "--verbose"),
    "--version",
)
"""Options of ``robotd run`` itself, and of ``robotd``."""

_Line = Annotated[str, Field(min_length=1, pattern=r"^[^\n]*$")]
_Flag = Annotated[str, Field(pattern=r"^--[a-z][a-z0-9-]*(/--[a-z][a-z0-9-]*)?$")]
Target = Annotated[str, Field(pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_][\w.]*$")]
OptionalTarget = Annotated[str, Field(pattern=r"^([A-Za-z_][\w.]*:[A-Za-z_][\w.]*)?$")]
_NodeName = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]


@dataclass(frozen=True, config={"extra": "forbid"})
class FeatureOption:
    """Option of ``robotd run``, short for ``--set KEY=VALUE``.

    Attributes:
        flag: as click takes it: ``--page``, or ``--page-control/--no-page-control``.
        key: key of the robot's file, dotted; the feature's own.
        help: one sentence.
        metavar: name of the value in the help; "" for a flag without one.
        type: type of click that parses the value; None for a flag without one.
        omitted: value of the option where none is given with it; None: one has to be.
    """

    flag: _Flag
    key: str
    help: _Line
    metavar: str = ""
    type: Any = None
    omitted: Any = None

    @property
    def flags(self) -> tuple[str, ...]:
        """Words of the command line that belong to it."""
        return tuple(self.flag.split("/"))

    def parameter(
        self, keep: Callable[[click.Context, click.Parameter, Any], None]
    ) -> click.Option:
        """Return the option for click, which calls ``keep`` with its value."""
        optional = {} if self.omitted is None else {"is_flag": False, "flag_value": self.omitted}
        return click.Option(
            [self.flag],
            metavar=self.metavar or None,
            type=self.type,
            default=None,
            help=self.help,
            expose_value=False,
            callback=keep,
            **optional,
        )

    @model_validator(mode="after")
    def _is_an_option(self) -> Self:
        try:
            self.parameter(lambda *_: None)
        except Exception as error:
            raise ValueError(f"click does not take {self.flag!r}: {error}") from error
        return self


@dataclass(frozen=True, config={"extra": "forbid"})
class Feature:
    """Part that runs alongside a robot. A field that is wrong raises ValidationError of pydantic.

    Attributes:
        summary: one line for ``robotd features``.
        settings: model whose fields are keys at the top level of the robot's file, all with a
            default; ``robot.descriptor.settings(model)`` returns its values. None of the keys may
            be one of robotd's own or of another feature.
        options: of ``robotd run``.
        open: ``package.module:function``, called as ``function(host: FeatureHost)`` before the
            robot starts. It returns a context manager that is left after the robot has shut down;
            its value is the running part, None where the robot does not want it. In the main
            thread; after 30 s it is interrupted, as is ``prepare``.
        prepare: ``package.module:function``, called as ``function(descriptor, backend)`` before
            the robot is made; it returns the descriptor to be used. "": none.
        nodes: ``package.module:function``, called as ``function(context: NodeContext, part)``
            where ROS nodes run and the part is not None. It returns a context manager, whose value
            is a list of further nodes or None. "": none.
        node_names: names of the nodes that ``nodes`` may add.
        after: names of features that are opened before this one, as far as they are installed.
        guards: what keeps the robot's motion within bounds, by the key of its file that asks for
            it, dotted: ``package.module:function``, called as ``function(robot)`` when the robot
            is made, by whatever program, unless the key is null or false. ``Robot.feature`` of the
            function returns what it has made.
    """

    summary: _Line
    settings: type[BaseModel]
    open: Target
    options: tuple[FeatureOption, ...] = ()
    prepare: OptionalTarget = ""
    nodes: OptionalTarget = ""
    node_names: tuple[_NodeName, ...] = ()
    after: tuple[str, ...] = ()
    guards: Mapping[str, Target] = field(default_factory=dict)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the robot's file that belong to it."""
        return tuple(self.settings.model_fields)

    @field_validator("settings")
    @classmethod
    def _has_defaults(cls, settings: type[BaseModel]) -> type[BaseModel]:
        for key, value in settings.model_fields.items():
            if value.is_required():
                raise ValueError(f"the key {key!r} has no default")
            if (value.alias or key) != key:
                raise ValueError(f"the key {key!r} has an alias, {value.alias!r}")
        try:
            settings.model_validate({})
        except Exception as error:
            what = plugin_failure(error, settings.__module__)
            raise ValueError(f"a robot's file without its keys fails: {what}") from error
        return settings

    @model_validator(mode="after")
    def _has_keys(self) -> Self:
        asked = [(f"options: {option.flag}", option.key) for option in self.options]
        for what, key in (*asked, *(("guards:", key) for key in self.guards)):
            if wrong := _unknown_key(self.settings, key):
                raise ValueError(f"{what} {key!r}: {wrong}")
        flags = [flag for option in self.options for flag in option.flags]
        if twice := {flag for flag in flags if flags.count(flag) > 1}:
            raise ValueError(f"options: more than one is called {min(twice)}")
        for key in self.guards:
            if requests(self.settings(), key):
                raise ValueError(f"guards: {key!r}: its default must be null or false")
        return self


def requests(settings: BaseModel, key: str) -> bool:
    """Return whether a dotted key is neither null nor false."""
    value: Any = reduce(getattr, key.split("."), settings)
    return value is not None and value is not False


def _unknown_key(settings: type[BaseModel], dotted: str) -> str:
    """Return why a model has no key; "" where it has it, or below what is not a model."""
    model: Any = settings
    for key in dotted.split("."):
        if not (isinstance(model, type) and issubclass(model, BaseModel)):
            return ""
        if key not in model.model_fields:
            return f"{model.__name__} has no {key!r}{did_you_mean(key, model.model_fields)}"
        model = model.model_fields[key].annotation
    return ""


def installed_features() -> Mapping[str, Feature]:
    """Return the features by name, in the order in which they are opened. Any thread.

    One of ``feature_failures`` is left out, with its keys and options.
    """
    return _loaded(tuple(sys.path)).features


def feature_failures() -> Mapping[PluginOrigin, str]:
    """Return why features cannot be used: texts that name distribution and field. Any thread."""
    return _loaded(tuple(sys.path)).failures


def feature_origin(name: str) -> PluginOrigin:
    """Return where one of ``installed_features`` comes from. Any thread."""
    return _loaded(tuple(sys.path)).origins[name]


def feature_errors(
    name: str, part: str, unchanged: tuple[type[BaseException], ...] = ()
) -> AbstractContextManager[None]:
    """Name the feature whose ``part``, a field of ``Feature``, raises; see ``plugin_errors``.

    Errors of click are the user's.
    """
    origin, target = feature_origin(name), getattr(installed_features()[name], part)
    is_named = isinstance(target, str)
    what = f"feature {origin}: {part}" + (f" ({target})" if is_named else "")
    return plugin_errors(
        what, target if is_named else target.__module__, (click.ClickException, *unchanged)
    )


class _Loaded(NamedTuple):
    features: dict[str, Feature]
    failures: dict[PluginOrigin, str]
    origins: dict[str, PluginOrigin]


@lru_cache(maxsize=1)
def _loaded(path: tuple[str, ...]) -> _Loaded:
    """Load each feature, or find why it cannot be used; ``path``: where they are installed."""
    del path
    names = installed_names(FEATURES)
    found, failures = dict[PluginOrigin, Feature](), dict(names.refused)
    for origin, entry in names.entries.values():
        try:
            found[origin] = _load(origin, entry)
        except PluginError as error:
            failures[origin] = str(error)
    for (claim, origin), other in rivals(_claims(found)).items():
        failures[origin] = f"feature {origin}: its {claim} is taken by {other}"
        found.pop(origin, None)
    features = {origin.name: feature for origin, feature in found.items()}
    origins = {origin.name: origin for origin in found}
    while True:
        order = TopologicalSorter(
            {name: features.keys() & {*feature.after} for name, feature in features.items()}
        )
        try:
            ordered = {name: features[name] for name in order.static_order()}
        except CycleError as error:
            cycle: list[str] = error.args[1]
            for name in {name for name in cycle if not origins[name].is_own}:
                text = f"after: features wait for each other: {' → '.join(cycle)}"
                failures[origins[name]] = f"feature {origins[name]}: {text}"
                del features[name]
        else:
            return _Loaded(ordered, dict(sorted(failures.items())), origins)


def _load(origin: PluginOrigin, entry: EntryPoint) -> Feature:
    feature = load_entry(origin, entry)
    if not isinstance(feature, Feature):
        raise PluginError(f"feature {origin}: must be a Feature, is {type(feature).__name__}")
    return feature


def _claims(found: Mapping[PluginOrigin, Feature]) -> Iterator[tuple[str, PluginOrigin]]:
    """Yield the names that must be taken once, and who takes them."""
    from robotd.descriptor.model import own_keys  # which imports the features to load a file

    yield from ((f"key {key!r}", OWNER) for key in own_keys())
    yield from ((f"option {flag!r}", OWNER) for flag in RUN_OPTIONS)
    for origin, feature in found.items():
        yield from ((f"key {key!r}", origin) for key in feature.keys)
        yield from (
            (f"option {flag!r}", origin) for option in feature.options for flag in option.flags
        )
        yield from ((f"node {name!r}", origin) for name in feature.node_names)
