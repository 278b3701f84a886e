"""The reference pages say what the code has: hooks, errors, options, exit statuses, names."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import robotd
from robotd.api import API_VERSION
from robotd.cli.commands import RATE_HZ, main
from robotd.cli.exit_codes import ExitCode
from robotd.descriptor import CycleSettings
from robotd.errors import RobotdError
from robotd.log import LEVELS, LogFormat
from robotd.motion.rejection import TrajectoryRejected
from robotd.plugin.hookspecs import RobotdHooks

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"

PUBLIC = {
    "ConnectError",
    "DescriptorError",
    "DeviceTimeout",
    "InvalidArgument",
    "NotReady",
    "OperationError",
    "PluginError",
    "Robot",
    "RobotdError",
    "Unsupported",
    "build_robot",
    "open_robot",
}


def page(name: str) -> str:
    return (REFERENCE / name).read_text(encoding="utf-8")


def headings(name: str) -> list[str]:
    return re.findall(r"^## `?(.*?)`?$", page(name), re.MULTILINE)


def signatures() -> list[str]:
    found = []
    for name, hook in vars(RobotdHooks).items():
        if name.startswith("robotd_"):
            signature = inspect.signature(hook)
            arguments = ", ".join(map(str, [*signature.parameters.values()][1:]))
            arguments = arguments.replace("'", "")
            found.append(f"{name}({arguments}) -> {signature.return_annotation}")
    return found


def errors(kind: type[Exception] = RobotdError) -> Iterator[type[Exception]]:
    """``kind`` and all below it that belong to robotd itself."""
    yield kind
    for child in kind.__subclasses__():
        if child.__module__.startswith("robotd."):
            yield from errors(child)


def test_every_hook_has_a_heading_with_its_signature_in_call_order() -> None:
    assert headings("hooks.md") == signatures()


def test_the_hooks_page_states_the_api_version() -> None:
    assert f"`API_VERSION`, {API_VERSION} now" in page("hooks.md")


def test_every_error_has_a_heading_and_no_other_is_there() -> None:
    assert TrajectoryRejected in set(errors())
    assert set(headings("errors.md")) == {error.__name__ for error in errors()}


def test_the_tree_of_errors_is_the_one_of_the_classes() -> None:
    tree = page("errors.md").split("```")[1]
    drawn: list[tuple[int, str]] = [
        ((match.start(1) + 3) // 4, match[1])
        for line in tree.strip().splitlines()
        if (match := re.search(r"(\w+)", line))
    ]
    parents: dict[int, str] = {}
    for depth, name in drawn:
        parents[depth] = name
        error = next(error for error in errors() if error.__name__ == name)
        if depth:
            assert parents[depth - 1] in {base.__name__ for base in error.__bases__}
    assert {name for _, name in drawn} == {error.__name__ for error in errors()}


def commands() -> dict[str, click.Command]:
    return {f"robotd {name}": command for name, command in main.commands.items()}


def section(command: str) -> str:
    return page("cli.md").split(f"## {command}\n")[1].split("\n## ")[0]


def test_every_command_has_a_heading() -> None:
    assert set(headings("cli.md")) == {*commands(), "Commands of plugins", "Exit status"}


@pytest.mark.parametrize("command", ["robotd run", "robotd check", "robotd export"])
def test_every_option_is_explained_with_its_command(command: str) -> None:
    text = section(command)
    for option in commands()[command].params:
        assert f"`{option.opts[0]}" in text


def test_every_option_of_the_lists_is_explained() -> None:
    for name in ("robotd robots", "robotd backends", "robotd nodes"):
        for option in commands()[name].params:
            assert f"`{option.opts[0]}`" in section("robotd nodes")


def test_the_page_explains_no_option_that_is_not_there() -> None:
    params = [item for command in (main, *commands().values()) for item in command.params]
    known = {name for item in params for name in item.opts}
    explained = set(re.findall(r"`(--[a-z-]+)", page("cli.md")))
    assert explained - known - {"--help", "--ros-args", "--params-file"} == set()


def test_every_exit_status_is_explained() -> None:
    rows = re.findall(r"^\| (\d+) \| ([A-Z]+) \|", page("cli.md"), re.MULTILINE)
    assert {(int(number), name) for number, name in rows} == {
        (int(code), code.name) for code in ExitCode
    }


def test_options_offer_what_the_code_accepts() -> None:
    choices = {
        option.name: list(option.type.choices)
        for option in main.commands["run"].params
        if isinstance(option.type, click.Choice)
    }
    assert choices == {"log_level": list(LEVELS), "log_format": list(LogFormat)}
    limits = CycleSettings.model_json_schema()["properties"]["rate_hz"]
    assert (RATE_HZ.min, RATE_HZ.max) == (limits["minimum"], limits["maximum"])


def test_the_public_names_are_pinned() -> None:
    assert set(robotd.__all__) == PUBLIC
    assert sorted(robotd.__all__) == robotd.__all__
    for name in PUBLIC:
        assert getattr(robotd, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        robotd.nonsense  # noqa: B018
