"""Faults of plugins, each in a real distribution, and their error messages."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd.api import API_VERSION, BackendOptions, Capability, DeviceContext
from robotd.descriptor import RobotDescriptor
from robotd.errors import ConnectError, DescriptorError, PluginError, Unsupported
from robotd.plugin.manager import (
    PLUGINS,
    Backend,
    discover,
    load_backend,
    load_plugins,
    register_all,
)

Install = Callable[..., Path]

IMPORTS = "from robotd.api import BackendInfo, BackendOptions, hookimpl\n"


def backend_source(*hooks: str, **info: str) -> str:
    """A backend's module: its description with ``info``, then ``hooks`` without their marks."""
    fields = {"summary": "''", "api_version": "1"} | info
    arguments = ", ".join(f"{key}={value}" for key, value in fields.items())
    describe = f"def robotd_backend(): return BackendInfo({arguments})"
    return IMPORTS + "".join(f"@hookimpl\n{hook}\n" for hook in (describe, *hooks))


def context(**changes: object) -> DeviceContext[BackendOptions]:
    values = {"schema": 1, "name": "bench", "axes": 2} | changes
    return DeviceContext(RobotDescriptor.model_validate(values), BackendOptions())


def rejection(name: str = "odd") -> str:
    with pytest.raises(PluginError) as caught:
        load_backend(name)
    return str(caught.value)


def test_a_backend_is_found_with_its_origin_and_described(install: Install) -> None:
    install("odd")
    backend = load_backend("odd")
    assert backend.name == "odd"
    assert backend.info.api_version == API_VERSION
    assert str(backend.origin) == "'odd' (plugin_acme of acme 1.2)"


def test_only_the_backend_that_is_asked_for_is_imported(install: Install) -> None:
    install("odd")
    install("heavy", "raise SystemError('imported')", distribution="heavy")
    discover()
    assert not {"plugin_acme", "plugin_heavy"} & set(sys.modules)
    load_backend("odd")
    assert "plugin_acme" in sys.modules
    assert "plugin_heavy" not in sys.modules


def test_discovery_is_sorted_by_name(install: Install) -> None:
    install("zeta", distribution="first")
    install("alpha", distribution="second")
    names = [origin.name for origin, _ in discover()]
    assert names == sorted(names)
    assert {"alpha", "zeta"} <= set(names)


def test_an_unknown_backend_names_the_installed_ones_and_the_nearest(install: Install) -> None:
    install("canopen")
    text = rejection("canopn")
    assert "unknown backend 'canopn'" in text
    assert re.search(r"available: .*canopen.*sim", text)
    assert "did you mean 'canopen'?" in text


def test_two_distributions_with_one_name_are_both_named(install: Install) -> None:
    install("odd", distribution="one", version="1.0")
    install("odd", distribution="two", version="2.0")
    text = rejection()
    assert "the name 'odd' is taken by" in text
    assert "of one 1.0)" in text
    assert "of two 2.0)" in text
    assert not {"plugin_one", "plugin_two"} & set(sys.modules)


@pytest.mark.parametrize("version", [API_VERSION + 1, API_VERSION - 1])
def test_another_api_version_is_rejected_with_both_versions(install: Install, version: int) -> None:
    install("odd", backend_source(api_version=str(version)))
    text = rejection()
    assert f"plugin API {version}" in text
    assert f"API {API_VERSION}" in text
    assert "acme" in text


def test_a_backend_without_an_api_version_is_rejected(install: Install) -> None:
    source = backend_source().replace("api_version=1", "")
    install("odd", source)
    assert "BackendInfo.api_version: Field required" in rejection()


def test_the_version_is_told_first_where_the_hooks_are_another_versions_too(
    install: Install,
) -> None:
    hook = "def robotd_tool_changer(device): ..."
    install("odd", backend_source(hook, api_version="2"))
    assert "is written for robotd plugin API 2, this is API 1" in rejection()


def test_a_name_that_this_api_does_not_have_hints_at_the_version(install: Install) -> None:
    install("odd", "from robotd.api import ToolDriver")
    text = rejection()
    assert "cannot import name 'ToolDriver'" in text
    assert text.endswith("is it written for another plugin API? This is API 1")


def test_a_rejected_plugin_leaves_no_trace_for_the_next_one(install: Install) -> None:
    install("odd", backend_source("def robotd_opn_device(context): ..."), distribution="one")
    rejection()
    install("even", backend_source(), distribution="two")
    assert load_backend("even").name == "even"


@pytest.mark.parametrize("capability", ["AXES", "IO", "FIELDBUS"])
def test_a_derived_capability_is_not_declared(install: Install, capability: str) -> None:
    source = "from robotd.api import Capability\n" + backend_source(
        capabilities=f"frozenset({{Capability.{capability}}})"
    )
    install("odd", source)
    assert f"declares {capability.lower()}: these are derived from its hooks" in rejection()


def test_the_hooks_say_what_is_there(install: Install) -> None:
    backend = make_backend(install, "def robotd_io(): return None")
    assert backend.capabilities == {Capability.AXES, Capability.IO}


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        pytest.param(
            backend_source("def robotd_open_device(contxt): ..."),
            "robotd_open_device must not take 'contxt' (available: context)",
            id="unknown argument",
        ),
        pytest.param(
            backend_source("def robotd_opn_device(context): ..."),
            "unknown hook 'robotd_opn_device'; did you mean 'robotd_open_device'?",
            id="unknown hook",
        ),
        pytest.param("x = 1", "has no robotd hook", id="no hook"),
        pytest.param(
            IMPORTS + "def robotd_backend(): ...", "has no robotd hook", id="hook without mark"
        ),
        pytest.param(
            backend_source("async def robotd_open_device(context): ..."),
            "robotd_open_device must not be async",
            id="async hook",
        ),
        pytest.param("import not_there_at_all", "ModuleNotFoundError", id="import error"),
        pytest.param("def broken(:", "SyntaxError", id="syntax error"),
        pytest.param("1 / 0", "division by zero (plugin_acme.py:1)", id="raises in import"),
        pytest.param(
            IMPORTS + "@hookimpl\ndef robotd_backend(): raise OSError('no licence')",
            "robotd_backend failed: OSError: no licence (plugin_acme.py:3)",
            id="raises in hook",
        ),
        pytest.param(
            IMPORTS + "@hookimpl\ndef robotd_backend(): return 'odd'",
            "robotd_backend returned str, not a BackendInfo",
            id="wrong type",
        ),
        pytest.param(
            backend_source(options="dict"),
            "BackendInfo.options: must be a subclass of BackendOptions",
            id="options",
        ),
        pytest.param(
            IMPORTS + "@hookimpl\ndef robotd_open_device(context): ...",
            "does not answer the hook robotd_backend",
            id="no description",
        ),
    ],
)
def test_a_broken_backend_is_rejected_with_its_origin_and_the_reason(
    install: Install, source: str, reason: str
) -> None:
    install("odd", source)
    text = rejection()
    assert "'odd' (plugin_acme of acme 1.2)" in text
    assert reason in text


def make_backend(install: Install, *hooks: str, **info: str) -> Backend:
    install("odd", backend_source(*hooks, **info))
    return load_backend("odd")


def test_a_device_hook_of_the_wrong_type_is_rejected(install: Install) -> None:
    backend = make_backend(install, "def robotd_open_device(context): return 5")
    with pytest.raises(PluginError, match="robotd_open_device returned int, not a DeviceDriver"):
        backend.drivers(context())


def test_a_missing_device_hook_is_rejected(install: Install) -> None:
    backend = make_backend(install)
    with pytest.raises(PluginError, match="does not answer the hook robotd_open_device"):
        backend.drivers(context())


def test_a_hook_that_raises_becomes_a_plugin_error(install: Install) -> None:
    backend = make_backend(install, "def robotd_open_device(context): raise KeyError('bus')")
    with pytest.raises(PluginError, match="robotd_open_device failed: KeyError: 'bus'") as caught:
        backend.drivers(context())
    assert isinstance(caught.value.__cause__, KeyError)


def test_an_error_of_robotd_passes_unchanged(install: Install) -> None:
    hook = "def robotd_open_device(context):\n    raise ConnectError('no bus')"
    source = backend_source(hook).replace("BackendOptions,", "BackendOptions, ConnectError,")
    install("odd", source)
    with pytest.raises(ConnectError, match=r"^no bus$"):
        load_backend("odd").drivers(context())


DRIVERS = (
    "def robotd_open_device(): return FakeDevice()",
    "def robotd_axes(device): return FakeAxes(2)",
)
FAKES = "from tests.fakes import FakeAxes, FakeDevice, FakeFieldbus\n"


def make_complete(install: Install, *hooks: str, before: str = "", **info: str) -> Backend:
    """A backend with a device and axes."""
    needed = FAKES + "from robotd.api import *\n" + before
    source = needed + backend_source(*DRIVERS, *hooks, **info)
    install("odd", source)
    return load_backend("odd")


def test_hooks_may_be_left_out_or_answer_none(install: Install) -> None:
    backend = make_complete(install, "def robotd_io(): return None")
    drivers = backend.drivers(context())
    assert drivers.io is None
    assert drivers.fieldbus is None
    assert drivers.make_fault_injector() is None
    assert drivers.capabilities(frozenset()) == {Capability.AXES}


def test_a_hook_gets_the_object_that_the_device_hook_returned(install: Install) -> None:
    seen = "def robotd_io(device):\n    seen.append(type(device))"
    backend = make_complete(install, seen, before="seen = []\n")
    backend.drivers(context())
    assert [kind.__name__ for kind in sys.modules["plugin_acme"].seen] == ["FakeDevice"]


BARE = """
class Bare(AxisDriver):
    def read(self, image): ...
    def servo(self, axis, on, timeout_s): ...
    def clear_alarm(self, axis, timeout_s): ...
    def move(self, axis, target, profile): ...
    def stop(self, axes): ...
    def begin_stream(self, axes): ...
    def stream(self, position, velocity, due_ns): ...
    def end_stream(self, axes): ...
"""


@pytest.mark.parametrize(
    ("capability", "lacks"),
    [
        ("VELOCITY_MODE", "Bare has no method jog()"),
        ("TORQUE_MODE", "Bare has no method set_command_mode()"),
        ("HAND_GUIDING", "Bare has no method begin_guiding()"),
        ("HOMING", "Bare has no method home()"),
        ("SCALING", "Bare has no method set_polarity()"),
        ("TRAJECTORIES_ON_DEVICE", "Bare has no method follow()"),
        ("STATISTICS", "there is no FieldbusDriver for reset_statistics()"),
        ("HOT_CONNECT", "there is no FieldbusDriver for start_hot_connect()"),
    ],
)
def test_a_capability_without_its_method_is_rejected(
    install: Install, capability: str, lacks: str
) -> None:
    declared = f"frozenset({{Capability.{capability}}})"
    before = BARE + "FakeAxes = lambda axes: Bare()\n"
    backend = make_complete(install, before=before, capabilities=declared)
    with pytest.raises(PluginError) as caught:
        backend.drivers(context())
    assert f"'{capability.lower()}' is declared, but {lacks}" in str(caught.value)


def test_methods_that_no_capability_needs_may_be_left_out(install: Install) -> None:
    backend = make_complete(install, before=BARE + "FakeAxes = lambda axes: Bare()\n")
    axes = backend.drivers(context()).axes
    with pytest.raises(Unsupported, match=r"^homing: not supported by the odd backend$"):
        axes.home(0, 1.0)


def test_setpoints_have_to_go_somewhere(install: Install) -> None:
    before = BARE.replace("begin_stream", "begin_streem") + "FakeAxes = lambda axes: Bare()\n"
    backend = make_complete(install, before=before)
    with pytest.raises(PluginError, match=r"setpoints are streamed, but Bare has no.*begin_stream"):
        backend.drivers(context())


def test_the_result_of_the_options_check_reaches_the_device(install: Install) -> None:
    model = (
        "checks = []\n"
        "class Options(BackendOptions):\n"
        "    def check_robot(self, robot):\n"
        "        checks.append(robot.name)\n"
        "        return {'planned for': robot.name}\n"
    )
    backend = make_complete(install, before=model, options="Options")
    made = backend.context(context().robot)
    assert made.options == {"planned for": "bench"}
    backend.drivers(made)
    assert sys.modules["plugin_acme"].checks == ["bench"]


def test_options_are_validated_by_the_backends_own_model(install: Install) -> None:
    model = "class Options(BackendOptions):\n    bitrate_hz: int = 500000\n"
    source = backend_source(options="Options").replace("@hookimpl", f"{model}@hookimpl", 1)
    install("odd", source)
    backend = load_backend("odd")
    assert backend.context(context().robot).options.model_dump() == {"bitrate_hz": 500000}
    wrong = context(backends={"odd": {"bitrat_hz": 1}}).robot
    with pytest.raises(DescriptorError, match="did you mean 'bitrate_hz'"):
        backend.context(wrong)


def test_plugins_of_the_other_group_load_each_on_its_own(install: Install, tmp_path: Path) -> None:
    robots = tmp_path / "robots"
    robots.mkdir()
    good = f"""
        from pathlib import Path
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_robots(registry):
            registry.add_folder(Path({str(robots)!r}))

        @hookimpl
        def robotd_register_nodes(registry):
            registry.add("lights", "acme.lights:Lights")
    """
    install("good", good, distribution="good", group=PLUGINS)
    install("bad", "import not_there_at_all", distribution="bad", group=PLUGINS)
    plugins, failures = load_plugins()
    names = [plugin.origin.name for plugin in plugins]
    assert names == sorted(names)
    assert "good" in names
    assert "bad" not in names
    assert [origin.name for origin in failures] == ["bad"]
    assert all("not_there_at_all" in reason for reason in failures.values())
    registered, nodes, missing = register_all(plugins)
    assert not missing
    assert registered.folders == [robots]
    assert nodes.nodes["lights"].factory == "acme.lights:Lights"


def test_a_node_of_two_plugins_is_left_out_and_hides_no_other(install: Install) -> None:
    source = """
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_nodes(registry):
            registry.add("lights", __name__ + ":Lights")
            registry.add(__name__, __name__ + ":Own")
    """
    install("one", source, distribution="one", group=PLUGINS)
    install("two", source, distribution="two", group=PLUGINS)
    _, nodes, failures = register_all(load_plugins()[0])
    assert {"plugin_one", "plugin_two"} <= nodes.nodes.keys()
    with pytest.raises(DescriptorError, match=r"node 'lights' is taken by 'one' \(plugin_one"):
        nodes.select(["lights"])
    texts = {origin.distribution: text for origin, text in failures.items()}
    assert texts["one"] == (
        "plugin 'one' (plugin_one of one 1.2): node 'lights' is taken by"
        " 'two' (plugin_two of two 1.2)"
    )
    assert texts.keys() == {"one", "two"}


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('registry.add_folder(Path("/does/not/exist"))', "/does/not/exist does not exist"),
        ('registry.add_folder("/tmp")', "robot folder must be a Path (value '/tmp')"),
        ("registry.add_folder(registry)", "robot folder must be a Path"),
        ("raise KeyError(3)", "robotd_register_robots failed: KeyError: 3 (plugin_one.py:7)"),
    ],
)
def test_a_hook_that_fails_hides_only_its_own(install: Install, line: str, says: str) -> None:
    source = f"""
        from pathlib import Path
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_robots(registry):
            {line}

        @hookimpl
        def robotd_register_nodes(registry):
            registry.add("lights", "acme:Lights")
    """
    install("one", source, distribution="one", group=PLUGINS)
    _, nodes, failures = register_all(load_plugins()[0])
    assert "wmx_engine_node" in nodes.nodes
    assert "lights" not in nodes.nodes
    [text] = failures.values()
    assert text.startswith("plugin 'one' (plugin_one of one 1.2): ")
    assert says in text
