"""Node names: known ones, plugins' ones, and misspelt ones."""

from __future__ import annotations

import pytest

from robotd.errors import DescriptorError, PluginError
from robotd.plugin.registry import NodeRegistry
from robotd.ros.registry import BUILT_IN, check_names, known_nodes, make_node


def registry(name: str, factory: str) -> NodeRegistry:
    nodes = NodeRegistry()
    nodes.add(name, factory)
    return nodes


def test_a_misspelt_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(DescriptorError, match=r"'wmx_engin_node'.*did you mean 'wmx_engine_node'"):
        check_names(["wmx_io_node", "wmx_engin_node"])


def test_a_name_like_no_other_is_answered_with_all() -> None:
    with pytest.raises(DescriptorError, match="there are wmx_engine_node, "):
        check_names(["zzz"])


def test_plugins_add_nodes_and_cannot_replace_built_in_ones() -> None:
    nodes = known_nodes(registry("weather", "sky.nodes:Weather"))
    assert set(nodes) == {*BUILT_IN, "weather"}
    with pytest.raises(PluginError, match="'manipulator_state' of x:y"):
        known_nodes(registry("manipulator_state", "x:y"))


def test_a_plugin_s_factory_is_called_with_robot_and_host() -> None:
    # divmod stands for any callable of two arguments.
    assert make_node("sun", 7, 2, registry("sun", "builtins:divmod")) == (3, 1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("factory", "reason"),
    [
        ("no_such_package.nodes:Sun", "ModuleNotFoundError"),
        ("robotd.errors:Sun", "AttributeError"),
        ("math:sqrt", "TypeError"),
    ],
)
def test_a_factory_that_fails_is_the_plugin_s_error(factory: str, reason: str) -> None:
    with pytest.raises(PluginError, match=rf"'sun' \({factory}\) cannot be made: {reason}"):
        make_node("sun", object(), object(), registry("sun", factory))  # type: ignore[arg-type]
