"""Broken plugins of third parties: each is named, and a robot without it runs as before."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import dedent

import click
import pytest
from click.testing import CliRunner
from structlog.testing import capture_logs

from robotd import entry_points, feature_host
from robotd.cli import main
from robotd.cli.installed import load_installed
from robotd.cli.run_command import run
from robotd.clock.simulated import SteppedClock
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.device.state import ConnectionState
from robotd.errors import PluginError
from robotd.feature import feature_failures
from robotd.feature_host import call_each, open_features, prepared
from robotd.plugin import manager
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_inventory.plugin_examination import distributions, examine_here

RELEASE = "acme 1.2"
FEATURE = """
    from contextlib import contextmanager
    import click
    from pydantic import BaseModel, Field, model_validator
    from robotd.api import InvalidArgument
    from robotd.api.features import Feature, FeatureOption, Section

    class Lights(Section):
        brightness: float = 0.5

    class Keys(Section):
        lights: Lights = Lights()

    def option(flag="--lights", key="lights.brightness", help="Brightness.", **more):
        return FeatureOption(flag, key, help, **more)

    @contextmanager
    def open_lights(host):
        yield None

    def feature(**more):
        fields = {"summary": "lights", "settings": Keys, "open": "MODULE:open_lights"}
        return Feature(**fields | more)
"""
HOOKS = """
    from pathlib import Path
    from robotd.api import BackendInfo, BackendOptions, Capability, hookimpl
"""
NODES = """
    @hookimpl
    def robotd_register_nodes(registry):
        """
ROBOTS = """
    @hookimpl
    def robotd_register_robots(registry):
        """
BACKEND = """
    @hookimpl
    def robotd_backend():
        return """
BASE = """
    from robotd.api.bases import DriveSettings
    class Drive(DriveSettings):
        """


@dataclass
class Broken:
    """A distribution ``acme 1.2`` with one entry.

    Attributes:
        id: what is wrong.
        group: of its entry point, without ``robotd.``.
        source: of its module; ``MODULE`` is the module's name.
        says: what the text contains beside ``acme 1.2``.
        name, value: of the entry point.
        files: written over those of the distribution.
    """

    id: str
    group: str
    source: str
    says: str
    name: str = "acme"
    value: str = "MODULE"
    files: dict[str, bytes] = field(default_factory=dict)


def feature(what: str, made: str, says: str, before: str = "") -> Broken:
    """A feature that ``made`` makes, after the lines ``before``."""
    source = dedent(FEATURE) + dedent(before) + f"\nFEATURE = {made}\n"
    return Broken(what, "features", source, says, value="MODULE:FEATURE")


def opened(what: str, function: str, says: str, more: str = "") -> Broken:
    """A feature whose ``open`` has the lines ``function``."""
    return feature(what, f"feature(open='MODULE:opened', {more})", says, function)


def plugin(what: str, lines: str, says: str, group: str = "plugins") -> Broken:
    return Broken(what, group, dedent(HOOKS) + dedent(lines), says)


BROKEN = (
    feature("no summary", "feature(summary='')", "Feature.summary: "),
    feature("summary is a number", "feature(summary=3)", "Feature.summary: must be a valid string"),
    feature("summary of two lines", "feature(summary='a\\nb')", "Feature.summary: "),
    feature("settings are an instance", "feature(settings=Keys())", "Feature.settings: "),
    feature("settings are not a model", "feature(settings=int)", "Feature.settings: "),
    feature(
        "a default that is wrong",
        "feature(settings=Wrong)",
        "Feature.settings: a robot's file without its keys fails: ValidationError: Wrong.lamp: ",
        "class Wrong(Section):\n    lamp: int = Field('x', validate_default=True)\n",
    ),
    feature(
        "a default that raises",
        "feature(settings=Wrong)",
        "Feature.settings: a robot's file without its keys fails: ZeroDivisionError",
        "class Wrong(Section):\n    lamp: float = Field(default_factory=lambda: 1 / 0)\n",
    ),
    feature(
        "settings that raise without keys",
        "feature(settings=Wrong)",
        "Feature.settings: a robot's file without its keys fails: KeyError: 'lamp'",
        """
        class Wrong(BaseModel):
            lamp: int = 0
            @model_validator(mode="before")
            @classmethod
            def check(cls, values):
                return {"lamp": values["lamp"]}
        """,
    ),
    feature(
        "a key without a default",
        "feature(settings=Wrong)",
        "Feature.settings: the key 'lamp' has no default",
        "class Wrong(Section):\n    lamp: int\n",
    ),
    feature(
        "a key with an alias",
        "feature(settings=Wrong)",
        "Feature.settings: the key 'lamp' has an alias, 'joints'",
        "class Wrong(Section):\n    lamp: int = Field(0, alias='joints')\n",
    ),
    feature("open without a function", "feature(open='acme.lights')", "Feature.open: "),
    feature("open is the function", "feature(open=open_lights)", "Feature.open: "),
    feature("no open", "Feature(summary='x', settings=Keys)", "Feature.open: Field required"),
    feature("an unknown field", "feature(nodez='a:b')", "Feature.nodez: Unexpected keyword"),
    feature("a flag without dashes", "feature(options=[option('lamp')])", "FeatureOption.flag: "),
    feature("a flag of two words", "feature(options=[option('--a b')])", "FeatureOption.flag: "),
    feature(
        "an option of a misspelt key",
        "feature(options=[option(key='lights.brigthness')])",
        "Lights has no 'brigthness'; did you mean 'brightness'?",
    ),
    feature(
        "an option of another's key",
        "feature(options=[option(key='cycle.rate_hz')])",
        "Keys has no 'cycle'",
    ),
    feature(
        "an option's type is a class of click",
        "feature(options=[option(type=click.Path)])",
        "FeatureOption: click does not take '--lights'",
    ),
    feature(
        "an option's help is empty", "feature(options=[option(help='')])", "FeatureOption.help"
    ),
    feature(
        "an option's name is a number",
        "feature(options=[option(metavar=3)])",
        "FeatureOption.metav",
    ),
    feature("options are a text", "feature(options='--lights')", "Feature.options: "),
    feature("options hold a text", "feature(options=('--lights',))", "Feature.options.0: "),
    feature(
        "one flag twice",
        "feature(options=[option(), option()])",
        "options: more than one is called --lights",
    ),
    feature("after is a number", "feature(after=3)", "Feature.after: "),
    feature("it comes after itself", "feature(after=('acme',))", "after: features wait for each"),
    feature("a node of two words", "feature(node_names=('a b',))", "Feature.node_names.0: "),
    feature(
        "a guard without a function", "feature(guards={'lights': 'x'})", "Feature.guards.light"
    ),
    feature(
        "a guard of every robot",
        "feature(guards={'lights.brightness': 'a:b'})",
        "guards: 'lights.brightness': its default must be null or false",
    ),
    feature("a guard of no key", "feature(guards={'lamps': 'a:b'})", "Keys has no 'lamps'"),
    feature("a class", "Keys", "must be a Feature, is ModelMetaclass"),
    feature("a function", "open_lights", "must be a Feature, is function"),
    feature(
        "a key of robotd",
        "feature(settings=Wrong)",
        "its key 'nodes' is taken by robotd",
        "class Wrong(Section):\n    nodes: int = 0\n",
    ),
    feature(
        "a key that files begin with",
        "feature(settings=Wrong)",
        "its key 'extends' is taken by robotd",
        "class Wrong(Section):\n    extends: str = ''\n",
    ),
    feature(
        "an option of the run",
        "feature(options=[option('--time-scale')])",
        "its option '--time-scale' is taken by robotd",
    ),
    feature(
        "the second word of an option",
        "feature(options=[option('--lights/--no-page-control')])",
        "its option '--no-page-control' is taken by 'page' (",
    ),
    Broken("no such object", "features", "", "AttributeError", value="MODULE:FEATURE"),
    Broken("no such module", "features", "", "ModuleNotFoundError", value="MODULE_x:FEATURE"),
    Broken("bad syntax", "features", "def", "cannot be imported: SyntaxError", value="MODULE:F"),
    Broken("it hangs", "features", "import time; time.sleep(40)", "not done within 0.3 s"),
    Broken("it exits", "features", "raise SystemExit(3)", "cannot be imported: SystemExit: 3"),
    Broken(
        "an exception that is none",
        "features",
        "class Boom(BaseException): ...\nraise Boom('x')",
        "cannot be imported: Boom: x (MODULE.py:2)",
    ),
    Broken(
        "an exception without a text",
        "features",
        "class Boom(Exception):\n    def __str__(self): 1 / 0\nraise Boom",
        "cannot be imported: Boom: without a text",
    ),
    Broken("a text of a megabyte", "features", "raise ValueError('x' * 10**6)", "ValueError: xxx"),
    opened("open of no module", "", "open (MODULE:opened) failed: AttributeError"),
    opened("open raises", "def opened(host): 1 / 0\n", "open (MODULE:opened) failed: ZeroDivision"),
    opened("open is refused", "def opened(host): raise InvalidArgument('lamp')\n", "lamp"),
    opened("open exits", "def opened(host): raise SystemExit\n", "failed: SystemExit"),
    opened(
        "open returns nothing", "def opened(host): ...\n", "returned NoneType, not a context man"
    ),
    opened("open yields", "def opened(host): yield\n", "returned generator, not a context manager"),
    opened(
        "it fails when left",
        "@contextmanager\ndef opened(host):\n    yield\n    1 / 0\n",
        "open (MODULE:opened) failed: ZeroDivisionError",
    ),
    opened(
        "it never yields",
        "@contextmanager\ndef opened(host):\n    return\n    yield\n",
        "failed: RuntimeError: generator didn't yield",
    ),
    opened(
        "a callback that is none",
        "@contextmanager\ndef opened(host):\n    host.on_ready.append(3)\n    yield\n",
        "3 cannot be called when the robot is served or ready",
    ),
    opened(
        "a callback that raises",
        "@contextmanager\ndef opened(host):\n    host.on_ready.append(lambda: 1 / 0)\n    yield\n",
        "ZeroDivisionError: division by zero (MODULE.py:",
    ),
    opened(
        "a reader of the tap that raises",
        "@contextmanager\ndef opened(host):\n    host.tap().add_reader(lambda: 1 / 0)\n    yield\n",
        "opened.<locals>.<lambda>",
    ),
    feature(
        "prepare raises",
        "feature(prepare='MODULE:change')",
        "prepare (MODULE:change) failed: ZeroDivisionError",
        "def change(descriptor, backend): 1 / 0\n",
    ),
    feature(
        "prepare returns nothing",
        "feature(prepare='MODULE:change')",
        "returned NoneType, not a RobotDescriptor",
        "def change(descriptor, backend): ...\n",
    ),
    opened(
        "open hangs",
        "import time\n@contextmanager\ndef opened(host):\n    time.sleep(40)\n    yield\n",
        "open (MODULE:opened) failed: Overdue: not done within 0.3 s (MODULE.py:",
    ),
    opened(
        "open hangs in a loop that swallows exceptions",
        "import threading\ndef opened(host):\n    while True:\n        try:\n"
        "            threading.Event().wait()\n        except Exception:\n            pass\n",
        "open (MODULE:opened) failed: Overdue: not done within 0.3 s (MODULE.py:",
    ),
    feature(
        "prepare hangs",
        "feature(prepare='MODULE:change')",
        "prepare (MODULE:change) failed: Overdue: not done within 0.3 s (MODULE.py:",
        "def change(descriptor, backend):\n    while True: ...\n",
    ),
    plugin("no hook", "x = 3", "has no robotd hook"),
    plugin("a folder that is a text", ROBOTS + "registry.add_folder('/tmp')", "must be a Path"),
    plugin("no folder", ROBOTS + "registry.add_folder(Path('/no'))", "folder /no does not exist"),
    plugin("a hook that raises", ROBOTS + "1 / 0", "robotd_register_robots failed: ZeroDivision"),
    plugin("a hook that exits", ROBOTS + "raise SystemExit", "robotd_register_robots failed: Sys"),
    plugin(
        "a hook that hangs",
        "    import time\n" + ROBOTS + "time.sleep(40)",
        "robotd_register_robots did not return within 0.3 s",
    ),
    plugin("an async hook", (ROBOTS + "...").replace("def", "async def"), "must not be async"),
    plugin("a misspelt hook", (ROBOTS + "...").replace("_robots", "_robot"), "unknown hook"),
    plugin(
        "a hook of unknown arguments", (ROBOTS + "...").replace("(reg", "(x, reg"), "not take 'x'"
    ),
    plugin("a node of two words", NODES + "registry.add('a b', 'a:b')", "(value 'a b')"),
    plugin("a factory without a name", NODES + "registry.add('a', 'b')", "NodeInfo.factory: "),
    plugin(
        "a summary that is none", NODES + "registry.add('a', 'b:c', summary=3)", "NodeInfo.summary"
    ),
    plugin(
        "a flag that is none",
        NODES + "registry.add('a', 'b:c', enables_servos='perhaps')",
        "NodeInfo.enables_servos: ",
    ),
    plugin(
        "parameters without a name",
        NODES + "registry.add('a', 'b:c', parameters='x')",
        "NodeInfo.parameters: ",
    ),
    plugin(
        "a reader of parameters without arguments",
        "    def read(): ...\n" + NODES + "registry.add('a', 'b:c', parameters='MODULE:read')",
        "node 'a': parameters (MODULE:read) does not take 2 arguments",
    ),
    plugin(
        "a node of robotd", NODES + "registry.add('robotd', 'a:b')", "'robotd' is taken by robotd"
    ),
    plugin(
        "a built-in node",
        NODES + "registry.add('wmx_io_node', 'a:b')",
        "node 'wmx_io_node' is taken by 'ros' (",
    ),
    plugin(
        "one node twice",
        NODES + "registry.add('a', 'a:b'); registry.add('a', 'a:c')",
        "node 'a' is registered twice: a:b and a:c",
    ),
    plugin("another server", NODES + "registry.serve_with('a:b')", "nodes are served by "),
    plugin("a backend that raises", BACKEND + "1 / 0", "robotd_backend failed: Zero", "backends"),
    plugin("a backend without a text", BACKEND + "None", "does not answer the hook", "backends"),
    plugin(
        "a backend as a mapping", BACKEND + "{}", "returned dict, not a BackendInfo", "backends"
    ),
    plugin(
        "a backend of another API",
        BACKEND + "BackendInfo('x', api_version=9)",
        "is written for robotd plugin API 9",
        "backends",
    ),
    plugin(
        "options that are none",
        BACKEND + "BackendInfo('x', 1, options=dict)",
        "BackendInfo.options: must be a subclass of BackendOptions",
        "backends",
    ),
    plugin(
        "capabilities that are none",
        BACKEND + "BackendInfo('x', 1, capabilities=['fly'])",
        "BackendInfo.capabilities",
        "backends",
    ),
    Broken("a backend of robotd's name", "backends", "", "the name 'sim' is taken by", "sim"),
    Broken(
        "a base that is none", "bases", "Drive = 3", "subclass of DriveSet", value="MODULE:Drive"
    ),
    Broken(
        "no kinematics",
        "bases",
        dedent(BASE + "KINEMATICS = ''"),
        "KINEMATICS must be package.module:function (value '')",
        value="MODULE:Drive",
    ),
    Broken(
        "kinematics that are not there",
        "bases",
        dedent(BASE + "KINEMATICS = 'MODULE:wheels'"),
        "KINEMATICS (MODULE:wheels) failed: AttributeError",
        value="MODULE:Drive",
    ),
    Broken("a base of robotd's name", "bases", "", "'mecanum' is taken by", "mecanum"),
    Broken(
        "a command that is none", "commands", "x = 3", "is not a click command", value="MODULE:x"
    ),
    Broken("a command of robotd's name", "commands", "", "the name 'run' is taken by", "run"),
    Broken("a command of two words", "commands", "", "the name must begin with a letter", "my cmd"),
    Broken(
        "a source in Latin-1",
        "commands",
        "",
        "cannot be imported: SyntaxError",
        files={"MODULE.py": b"x = '\xe9'\n"},
    ),
    Broken(
        "a table that is none", "codes", "T = {}", "must be a CodeTable, is dict", value="MODULE:T"
    ),
    Broken(
        "codes that are texts",
        "codes",
        "from robotd.api import CodeTable\nT = CodeTable('alarm', {'over-current': 1})",
        "CodeTable.texts.over-current",
        value="MODULE:T",
    ),
    Broken("a doctor that is none", "doctors", "x = 3", "is not a function: int", value="MODULE:x"),
    Broken(
        "a doctor without arguments",
        "doctors",
        "def look(): ...",
        "does not take 1 argument: too many positional arguments",
        value="MODULE:look",
    ),
    Broken("a scan of robotd's name", "scans", "", "'canopen' is taken by", "canopen"),
    Broken("an export of robotd's name", "exports", "", "the name 'urdf' is taken by", "urdf"),
    Broken(
        "an export that is none", "exports", "x = 3", "is not a function: int", value="MODULE:x"
    ),
    Broken("a check that is none", "checks", "x = 3", "is not a function: int", value="MODULE:x"),
    Broken("a value that is none", "features", "", "must be package.module", value="a b!"),
    Broken(
        "a line without a value",
        "features",
        "",
        "entry_points.txt cannot be read",
        files={"INFO/entry_points.txt": b"[robotd.features]\nacme\n"},
    ),
    Broken(
        "entry points in Latin-1",
        "features",
        "",
        "entry_points.txt cannot be read: UnicodeDecodeError",
        files={"INFO/entry_points.txt": b"[robotd.features]\n\xe9 = a:b\n"},
    ),
    Broken(
        "one name twice",
        "features",
        "",
        "the name 'acme' is taken by 'acme' (b:B of acme 1.2)",
        files={"INFO/entry_points.txt": b"[robotd.features]\nacme = a:A\nacme = b:B\n"},
    ),
)


@pytest.fixture
def installed(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Broken]:
    """The broken distribution, installed; its texts with the name of its module."""
    broken: Broken = request.param
    module = f"broken_{BROKEN.index(broken)}"
    info = f"{RELEASE.replace(' ', '-')}.dist-info"
    entries = f"[robotd.{broken.group}]\n{broken.name} = {broken.value}\n"
    files = {
        "MODULE.py": broken.source.encode(),
        "INFO/METADATA": b"Metadata-Version: 2.1\nName: acme\nVersion: 1.2\n",
        "INFO/entry_points.txt": entries.encode(),
    }
    (tmp_path / info).mkdir()
    for name, content in (files | broken.files).items():
        path = tmp_path / name.replace("INFO", info).replace("MODULE", module)
        path.write_bytes(content.replace(b"MODULE", module.encode()))
    monkeypatch.setattr(entry_points, "IMPORT_LIMIT_S", 0.3 if "hangs" in broken.id else 30.0)
    monkeypatch.setattr(feature_host, "OPEN_LIMIT_S", 0.3 if "hangs" in broken.id else 30.0)
    monkeypatch.setattr(manager, "HOOK_BUDGET_S", 0.3 if "hangs" in broken.id else 10.0)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield Broken(broken.id, broken.group, "", broken.says.replace("MODULE", module))
    sys.modules.pop(module, None)


def runs() -> list[str]:
    """Run a robot that asks for no plugin; return what is logged."""
    backend = load_backend("sim")
    with capture_logs() as lines:
        descriptor = prepared(load_robot_descriptor("standalone"), backend)
        robot = Robot(descriptor, backend, SteppedClock())
        with open_features(robot) as host:
            call_each(host.on_served)
            robot.start(enable=False)
            assert robot.connection.state is ConnectionState.COMMUNICATING
            call_each(host.on_ready)
            host.tap().observe()
            robot.shutdown()
    return [str(line) for line in lines]


def text_of() -> list[str]:
    """Return what robotd says of the distribution, wherever it says something."""
    assert CliRunner().invoke(main, ["--help"], prog_name="robotd").exit_code == 0
    context = click.Context(run, info_name="run")
    assert {"robot", "page"} <= {parameter.name for parameter in run.get_params(context)}
    at_start = [*load_installed().problems(), *feature_failures().values()]
    examined = [
        examine_here(*distribution) for distribution in distributions() if distribution[0] == "acme"
    ]
    return [
        *at_start,
        *(text for examination in examined for text in examination.problems),
        *runs(),
    ]


@pytest.mark.parametrize("installed", BROKEN, ids=lambda broken: broken.id, indirect=True)
def test_a_broken_plugin_is_named_and_a_robot_without_it_runs(installed: Broken) -> None:
    texts = text_of()
    named = [text for text in texts if installed.says in text]
    assert named, texts
    assert all(RELEASE in text for text in named), named
    assert max(map(len, named)) < 2500


@pytest.mark.parametrize(
    "installed", [broken for broken in BROKEN if broken.id == "open hangs"], indirect=True
)
def test_a_robot_that_asks_for_a_feature_that_hangs_does_not_start(installed: Broken) -> None:
    asked = load_robot_descriptor("standalone", overrides=[parse_override("lights.brightness=1")])
    robot = Robot(asked, load_backend("sim"), SteppedClock())
    with pytest.raises(PluginError, match="not done within"), open_features(robot):
        pass


def test_there_are_many_kinds_of_mistakes() -> None:
    ids = [(broken.group, broken.id) for broken in BROKEN]
    assert len(set(ids)) == len(ids) >= 60
    assert {f"robotd.{group}" for group, _ in ids} == {*entry_points.KINDS}
