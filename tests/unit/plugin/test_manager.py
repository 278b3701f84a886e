"""What can be wrong with a plugin, each on a real distribution, and what the user is told."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd.api import API_VERSION, DeviceContext
from robotd.descriptor import RobotDescriptor
from robotd.errors import ConnectError, DescriptorError, PluginError
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
    fields = {"name": "'odd'", "summary": "''", "capabilities": "frozenset()"} | info
    arguments = ", ".join(f"{key}={value}" for key, value in fields.items())
    describe = f"def robotd_backend(): return BackendInfo({arguments})"
    return IMPORTS + "".join(f"@hookimpl\n{hook}\n" for hook in (describe, *hooks))


def context(**changes: object) -> DeviceContext:
    values = {"schema": 1, "name": "bench", "axes": 2} | changes
    return DeviceContext(RobotDescriptor.model_validate(values))


def rejection(name: str = "odd") -> str:
    with pytest.raises(PluginError) as caught:
        load_backend(name)
    return str(caught.value)


def test_a_backend_is_found_with_its_origin_and_described(install: Install) -> None:
    install("odd")
    backend = load_backend("odd")
    assert backend.info.name == "odd"
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
    assert "no backend named 'canopn' is installed" in text
    assert re.search(r"installed: .*canopen.*sim", text)
    assert text.endswith("did you mean 'canopen'?")


def test_two_distributions_with_one_name_are_both_named(install: Install) -> None:
    install("odd", distribution="one", version="1.0")
    install("odd", distribution="two", version="2.0")
    text = rejection()
    assert "two plugins offer the backend 'odd'" in text
    assert "of one 1.0)" in text
    assert "of two 2.0)" in text
    assert not {"plugin_one", "plugin_two"} & set(sys.modules)


@pytest.mark.parametrize("version", [API_VERSION + 1, API_VERSION - 1])
def test_another_api_version_is_refused_with_both_versions(install: Install, version: int) -> None:
    install("odd", backend_source(api_version=str(version)))
    text = rejection()
    assert f"plugin API {version}" in text
    assert f"API {API_VERSION}" in text
    assert "acme" in text


def test_a_backend_that_calls_itself_otherwise_is_refused(install: Install) -> None:
    install("odd", backend_source(name="'even'"))
    assert "calls itself 'even'" in rejection()


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        pytest.param(
            backend_source("def robotd_open_device(contxt): ..."), "contxt", id="unknown argument"
        ),
        pytest.param(
            backend_source("def robotd_opn_device(context): ..."),
            "robotd_opn_device",
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
        pytest.param("1 / 0", "ZeroDivisionError: division by zero", id="raises in import"),
        pytest.param(
            IMPORTS + "@hookimpl\ndef robotd_backend(): raise OSError('no licence')",
            "robotd_backend failed: OSError: no licence",
            id="raises in hook",
        ),
        pytest.param(
            IMPORTS + "@hookimpl\ndef robotd_backend(): return 'odd'",
            "robotd_backend returned str, not a BackendInfo",
            id="wrong type",
        ),
        pytest.param(
            IMPORTS + "@hookimpl\ndef robotd_open_device(context): ...",
            "does not answer the hook robotd_backend",
            id="no description",
        ),
    ],
)
def test_a_broken_backend_is_refused_with_its_origin_and_the_reason(
    install: Install, source: str, reason: str
) -> None:
    install("odd", source)
    text = rejection()
    assert "'odd' (plugin_acme of acme 1.2)" in text
    assert reason in text


def make_backend(install: Install, *hooks: str, **info: str) -> Backend:
    install("odd", backend_source(*hooks, **info))
    return load_backend("odd")


def test_a_device_hook_of_the_wrong_type_is_refused(install: Install) -> None:
    backend = make_backend(install, "def robotd_open_device(context): return 5")
    with pytest.raises(PluginError, match="robotd_open_device returned int, not a DeviceDriver"):
        backend.open_device(context())


def test_a_missing_device_hook_is_refused(install: Install) -> None:
    backend = make_backend(install)
    with pytest.raises(PluginError, match="does not answer the hook robotd_open_device"):
        backend.open_device(context())


def test_a_hook_that_raises_becomes_a_plugin_error(install: Install) -> None:
    backend = make_backend(install, "def robotd_open_device(context): raise KeyError('bus')")
    with pytest.raises(PluginError, match="robotd_open_device failed: KeyError: 'bus'") as caught:
        backend.open_device(context())
    assert isinstance(caught.value.__cause__, KeyError)


def test_an_error_of_robotd_passes_unchanged(install: Install) -> None:
    hook = "def robotd_open_device(context):\n    raise ConnectError('no bus')"
    source = backend_source(hook).replace("BackendOptions,", "BackendOptions, ConnectError,")
    install("odd", source)
    with pytest.raises(ConnectError, match=r"^no bus$"):
        load_backend("odd").open_device(context())


def test_hooks_may_be_left_out_or_answer_none(install: Install) -> None:
    backend = make_backend(install, "def robotd_io(): return None")
    made = context()
    device = object()
    assert backend.io(device, made) is None  # type: ignore[arg-type]
    assert backend.fieldbus(device, made) is None  # type: ignore[arg-type]


def test_options_are_validated_by_the_backends_own_model(install: Install) -> None:
    model = "class Options(BackendOptions):\n    bitrate_hz: int = 500000\n"
    source = backend_source(options="Options").replace("@hookimpl", f"{model}@hookimpl", 1)
    install("odd", source)
    backend = load_backend("odd")
    assert backend.options(context().robot).model_dump() == {"bitrate_hz": 500000}
    wrong = context(backends={"odd": {"bitrat_hz": 1}}).robot
    with pytest.raises(DescriptorError, match="did you mean 'bitrate_hz'"):
        backend.options(wrong)


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
    assert [plugin.origin.name for plugin in plugins] == ["good"]
    assert [origin.name for origin in failures] == ["bad"]
    assert all("not_there_at_all" in reason for reason in failures.values())
    registered, nodes = register_all(plugins)
    assert registered.folders == [robots]
    assert nodes.nodes["lights"].factory == "acme.lights:Lights"


def test_two_plugins_with_one_node_stop_the_start(install: Install) -> None:
    source = """
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_nodes(registry):
            registry.add("lights", __name__ + ":Lights")
    """
    install("one", source, distribution="one", group=PLUGINS)
    install("two", source, distribution="two", group=PLUGINS)
    plugins, _ = load_plugins()
    with pytest.raises(PluginError, match=r"'lights' is registered twice: plugin_one.*plugin_two"):
        register_all(plugins)


def test_a_folder_that_does_not_exist_is_refused(install: Install) -> None:
    source = """
        from pathlib import Path
        from robotd.api import hookimpl

        @hookimpl
        def robotd_register_robots(registry):
            registry.add_folder(Path("/does/not/exist"))
    """
    install("one", source, group=PLUGINS)
    plugins, _ = load_plugins()
    with pytest.raises(PluginError, match="/does/not/exist does not exist"):
        register_all(plugins)
