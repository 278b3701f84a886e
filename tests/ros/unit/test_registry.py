"""Node names: known ones, plugins' ones, and misspelt ones."""

from __future__ import annotations

import pytest

from robotd.entry_points import PluginOrigin
from robotd.errors import DescriptorError, PluginError
from robotd.plugin.registry import NodeInfo, NodeRegistry
from robotd_ros.node_factory import make_node
from robotd_ros.node_names import OPERATOR_NODE, WORLD_NODE
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
    own = NodeRegistry()
    robotd_register_nodes(own)
    others = registry("weather", "sky.nodes:Weather")
    for name in ("manipulator_state", OPERATOR_NODE, WORLD_NODE):
        others.add(name, "x:y")
    origin = PluginOrigin("sky", "sky", "sky", "1")
    built_in = PluginOrigin("ros", "robotd_ros.plugin", "robotd", "1")
    failures: dict[PluginOrigin, str] = {}
    nodes = NodeRegistry.joined({origin: others, built_in: own}, failures)
    assert set(nodes.nodes) == {*BUILT_IN, "weather"}
    assert failures[origin].splitlines() == [
        "plugin 'sky' (sky of sky 1): node 'robotd' is taken by robotd",
        "plugin 'sky' (sky of sky 1): node 'robotd_world' is taken by robotd",
        f"plugin 'sky' (sky of sky 1): node 'manipulator_state' is taken by {built_in}",
    ]


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
    with pytest.raises(
        PluginError, match=rf"'sun' of plugin acme: {factory} cannot be made: {reason}"
    ):
        make_node("sun", NodeInfo(factory, "", owner="acme"), object(), object())  # type: ignore[arg-type]


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
