"""Comparison of a driver's methods with those of its contract: they get arguments by position."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

_BY_POSITION = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)


def signature_problems(driver: object, contract: type) -> Iterator[str]:
    """Yield one line for each method of ``contract`` that ``driver`` would be called wrongly."""
    for name in (name for name in dir(contract) if not name.startswith("_")):
        own, expected = inspect.getattr_static(type(driver), name), getattr(contract, name)
        if own is inspect.getattr_static(contract, name):
            continue
        where = f"{type(driver).__name__}.{name}"
        if isinstance(expected, property) or not callable(expected):
            if inspect.isroutine(own):
                yield f"{where} is a method, and in {contract.__name__} it is none: add @property"
            continue
        found = getattr(driver, name) if not isinstance(own, property) else None
        if not callable(found):
            yield f"{where} is not a method, and in {contract.__name__} it is one"
            continue
        if inspect.iscoroutinefunction(found) or inspect.isgeneratorfunction(found):
            yield f"{where} is async or a generator: its body would not be run"
            continue
        try:
            taken = [*inspect.signature(found).parameters.values()]
        except ValueError:  # of compiled code: not known
            continue
        given = [*inspect.signature(expected).parameters][1:]
        if problem := _mismatch(taken, given):
            contracted = f"{contract.__name__} has {name}({', '.join(given)})"
            yield f"{where} {problem}; {contracted}"


def _mismatch(taken: list[inspect.Parameter], given: list[str]) -> str:
    """Return what is wrong with a method that takes ``taken`` and is given ``given``; or ""."""
    places = [parameter for parameter in taken if parameter.kind in _BY_POSITION]
    takes_all = any(parameter.kind is inspect.Parameter.VAR_POSITIONAL for parameter in taken)
    for argument, place in zip(given, places, strict=False):
        # An unused argument may begin with an underscore.
        if place.name.strip("_") != argument:
            return f"takes {place.name!r} where it is given {argument!r}"
    if len(given) > len(places) and not takes_all:
        lacking = ", ".join(map(repr, given[len(places) :]))
        by_name = [
            parameter.name
            for parameter in taken
            if parameter.kind is inspect.Parameter.KEYWORD_ONLY
        ]
        how = " by position" if set(by_name) & set(given) else ""
        return f"does not take {lacking}{how}"
    further = [parameter for parameter in taken if parameter not in places[: len(given)]]
    variable = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    needed = [
        parameter
        for parameter in further
        if parameter.default is parameter.empty and parameter.kind not in variable
    ]
    if needed:
        names = ", ".join(repr(parameter.name) for parameter in needed)
        return f"needs {names}, which it is not given"
    return ""
