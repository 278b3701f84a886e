"""Validation errors as ``file:line: key.path: problem (value ...)``."""

from __future__ import annotations

import types
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from robotd.descriptor.base_kinds import AnyKind, base_models
from robotd.descriptor.yaml_tree import YamlNode
from robotd.errors import DescriptorError, did_you_mean
from robotd.feature import feature_failures

Model = TypeVar("Model", bound=BaseModel)

_MAX_FINDINGS = 200  # more than a text shows; each costs a search for the nearest known key
_CONSEQUENCE = "default_factory_not_called"  # of another finding, which is reported
_KEY = "[key]"  # of pydantic: the key of a mapping is wrong, not its value
_BOUNDS = {
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
}
_LENGTHS = {
    "too_short": "must have {min_length} or more items",
    "too_long": "must have {max_length} or fewer items",
}
_LIST, _MAPPING = "must be a list", "must be a mapping of keys to values"
_SHAPES = {"tuple_type": _LIST, "list_type": _LIST, "dict_type": _MAPPING, "model_type": _MAPPING}


def validate(
    model: type[Model], value: Any, tree: YamlNode | None, keys: Sequence[str | int] = ()
) -> Model:
    """Validate ``value``, which ``tree`` holds at ``keys``.

    Raises DescriptorError with every problem on a line of its own, in the order of the file.
    """
    try:
        return model.model_validate(value)
    except ValidationError as error:
        raise join(problems_of(model, error, tree, keys)) from None


def problems_of(
    model: type[BaseModel], error: ValidationError, tree: YamlNode | None, keys: Sequence[str | int]
) -> list[DescriptorError]:
    """Return one DescriptorError per finding of ``error``, at most ``_MAX_FINDINGS``."""
    findings = [found for found in error.errors() if found["type"] != _CONSEQUENCE]
    return [_problem(model, found, tree, keys) for found in findings[:_MAX_FINDINGS]]


def join(problems: Iterable[DescriptorError]) -> DescriptorError:
    """Return one error that lists each problem once, in the order of the file."""
    distinct = {str(problem): problem for problem in problems}.values()
    ordered = sorted(distinct, key=lambda problem: (str(problem.path), problem.line or 0))
    return DescriptorError.join(ordered)


def _problem(
    model: type[BaseModel], found: ErrorDetails, tree: YamlNode | None, prefix: Sequence[str | int]
) -> DescriptorError:
    loc = tuple(key for key in found["loc"] if key != _KEY)
    keys = (*prefix, *loc)
    node = tree.find(keys) if tree else None
    is_feature = len(keys) == 1 and found["type"] == "extra_forbidden"
    return DescriptorError(
        _text(model, found, loc) + _extension(tree, node) + (_unusable() if is_feature else ""),
        path=node.path if node else None,
        line=node.line if node else None,
        key=".".join(str(key) for key in keys) or None,
    )


def _extension(tree: YamlNode | None, node: YamlNode | None) -> str:
    """Return which file extends the one with the problem; "" where it is the same."""
    if tree is None or node is None or node.line is None or node.path == tree.path:
        return ""
    return f"; extended by {tree.path}"


def _unusable() -> str:
    """Return which features cannot be used, and why: the key may be one of theirs."""
    failures = "; ".join(feature_failures().values())
    return f"; features that cannot be used: {failures}" if failures else ""


def _text(model: type[BaseModel], found: ErrorDetails, loc: Sequence[str | int]) -> str:
    kind, context = found["type"], found.get("ctx", {})
    if kind == "extra_forbidden":
        key = str(loc[-1])
        if key.isdecimal() and found["input"] is None:  # {velocity_rad_s: 2,5}
            return "unknown key; a number has a decimal point, not a comma"
        return "unknown key" + did_you_mean(key, _keys_at(model, loc[:-1]))
    if kind == "missing":
        return "missing"
    if kind in _BOUNDS or kind in _LENGTHS:
        text = (_BOUNDS | _LENGTHS)[kind].format(**context)
    elif kind in _SHAPES:
        text = _SHAPES[kind]
    elif kind == "value_error":
        text = str(context["error"])
    elif kind == "string_pattern_mismatch":
        text = "must begin with a letter and hold only letters, digits and _"
    else:
        text = found["msg"].replace("Input should be", "must be")
    return f"{text} (value {_shown(found['input'])})"


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _keys_at(model: type[BaseModel], loc: Sequence[str | int]) -> list[str]:
    """Return the keys of the model at ``loc`` below ``model``; empty without one."""
    current: list[Any] = [model]
    for key in loc:
        current = [item for model in current for item in _below(model, str(key))]
    fields = [model.model_fields.items() for model in current if _is_model(model)]
    return list(dict.fromkeys(field.alias or name for named in fields for name, field in named))


def _below(annotation: Any, key: str) -> list[Any]:
    """Return the possible types of ``key`` in a model, or of a collection's items."""
    if _is_model(annotation):
        fields = {field.alias or name: field for name, field in annotation.model_fields.items()}
        return _alternatives(fields[key].annotation) if key in fields else []
    arguments = [item for item in get_args(annotation) if item is not ...]
    return _alternatives(arguments[-1]) if arguments else []


def _alternatives(annotation: Any) -> list[Any]:
    """Return the members of a union, without None; other types alone."""
    if get_origin(annotation) is Annotated:
        inner, *others = get_args(annotation)
        if any(isinstance(model, AnyKind) for model in others):
            return [*base_models()]
        return _alternatives(inner)
    if get_origin(annotation) not in (Union, types.UnionType):
        return [] if annotation is type(None) else [annotation]
    return [item for member in get_args(annotation) for item in _alternatives(member)]


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)
