from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from robotd.descriptor.inheritance import merge
from robotd.descriptor.yaml_tree import YamlNode

SCALARS = st.one_of(st.integers(0, 3), st.text("xy", max_size=2), st.booleans())
LEAVES = st.one_of(SCALARS, st.lists(SCALARS, max_size=2))


def mappings(leaves: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    keys = st.sampled_from("abcd")
    values = st.recursive(leaves, lambda inner: st.dictionaries(keys, inner, max_size=3))
    return st.dictionaries(keys, values, max_size=4)


BASES = mappings(LEAVES)
OVERLAYS = mappings(st.one_of(LEAVES, st.none()))


def node(value: Any) -> YamlNode:
    if isinstance(value, dict):
        value = {key: node(child) for key, child in value.items()}
    elif isinstance(value, list):
        value = [node(child) for child in value]
    return YamlNode(value, Path("robot.yaml"), 1)


def merged(base: Any, overlay: Any) -> Any:
    return merge(node(base), node(overlay)).plain()


def test_an_example() -> None:
    base = {"a": {"b": 1, "c": [1, 2]}, "d": "x", "e": 1}
    overlay = {"a": {"c": [3], "f": True}, "e": None, "g": None}
    assert merged(base, overlay) == {"a": {"b": 1, "c": [3], "f": True}, "d": "x", "g": None}


@given(BASES)
def test_nothing_changes_nothing(base: dict[str, Any]) -> None:
    assert merged(base, {}) == base
    assert merged({}, base) == base
    assert merged(base, base) == base


@given(BASES, BASES)
def test_the_overlay_wins_and_the_rest_stays(base: Any, overlay: Any) -> None:
    result = merged(base, overlay)
    assert merged(result, overlay) == result
    assert set(result) == set(base) | set(overlay)
    for key in set(base) - set(overlay):
        assert result[key] == base[key]
    for key, value in overlay.items():
        if not isinstance(value, dict) or not isinstance(base.get(key), dict):
            assert result[key] == value


@given(BASES, OVERLAYS)
def test_null_deletes_what_is_there_and_only_that(base: Any, overlay: Any) -> None:
    result = merged(base, overlay)
    for key, value in overlay.items():
        if value is None:
            assert (key in result) == (key not in base)


@given(BASES, OVERLAYS)
def test_neither_side_is_changed(base: Any, overlay: Any) -> None:
    left, right = node(base), node(overlay)
    merge(left, right)
    assert (left.plain(), right.plain()) == (base, overlay)
