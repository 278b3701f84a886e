"""Node names: known ones, plugins' ones, and misspelt ones."""

from __future__ import annotations

import pytest

from robotd.errors import DescriptorError, PluginError
from robotd.plugin.registry import NodeInfo, NodeRegistry
from robotd_ros.node_registry import make_node
from robotd_ros.plugin import BUILT_IN, built_in_nodes, robotd_register_nodes


def registry(name: str, factory: str) -> NodeRegistry:
    nodes = NodeRegistry()
    nodes.add(name, factory)
    return nodes


def test_a_misspelt_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(DescriptorError, match=r"'wmx_engin_node'.*did you mean 'wmx_engine_node'"):
        built_in_nodes().select(["wmx_io_node", "wmx_engin_node"])


def test_a_name_like_no_other_is_answered_with_all() -> None:
    with pytest.raises(DescriptorError, match="available: wmx_engine_node, "):
        built_in_nodes().select(["zzz"])


def test_plugins_add_nodes_and_cannot_replace_built_in_ones() -> None:
    nodes = registry("weather", "sky.nodes:Weather")
    robotd_register_nodes(nodes)
    assert set(nodes.nodes) == {*BUILT_IN, "weather"}
    clash = "'manipulator_state' of x:y has the name of a built-in node"
    with pytest.raises(PluginError, match=clash):  # in either order
        nodes.add("manipulator_state", "x:y")
    with pytest.raises(PluginError, match=clash):
        robotd_register_nodes(registry("manipulator_state", "x:y"))


def test_a_plugin_s_factory_is_called_with_robot_and_host() -> None:
    # divmod stands for any callable of two arguments.
    info = NodeInfo("builtins:divmod", "")
    assert make_node("sun", info, 7, 2) == (3, 1)  # type: ignore[arg-type]


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
        make_node("sun", NodeInfo(factory, ""), object(), object())  # type: ignore[arg-type]


def test_a_plugin_s_node_may_switch_servos_on_and_keep_a_failed_start() -> None:
    nodes = NodeRegistry()
    nodes.add("sun", "sky.nodes:Sun", summary="light", enables_servos=True)
    nodes.add("moon", "sky.nodes:Moon", keeps_failed_start=True)
    sun, moon = nodes.select(["sun", "moon"]).values()
    assert (sun.summary, sun.enables_servos, sun.keeps_failed_start) == ("light", True, False)
    assert (moon.summary, moon.enables_servos, moon.keeps_failed_start) == (
        "by sky.nodes",
        False,
        True,
    )
