"""The ``command`` directive: usage, arguments and options of a click command.

The text of the page is around it, so that a command is described in one place. A command
that no page documents is a warning.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.metadata import entry_points
from typing import Any

import click
from docutils import nodes
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

from robotd.cli import main
from robotd.cli.plugin_commands import COMMANDS
from robotd_docs.markdown import code
from robotd_doctor.model_tables import table

log = logging.getLogger(__name__)
DOCUMENTED: set[str] = set()
COMMON = {"--log-level", "--log-format", "--help"}  # explained once, at the top of the page


def commands(
    command: click.Command = main, path: tuple[str, ...] = ("robotd",)
) -> Iterator[tuple[str, click.Command]]:
    """Yield every command below ``command`` that is not a group, with its full name.

    Commands of plugins are included where robotd itself brings the plugin.
    """
    if not isinstance(command, click.Group):
        yield " ".join(path), command
        return
    context = click.Context(command, info_name=path[-1])
    names = command.list_commands(context)
    if command is main:
        entries = entry_points(group=COMMANDS)
        names += [entry.name for entry in entries if entry.dist and entry.dist.name == "robotd"]
    for name in names:
        found = command.get_command(context, name)
        if found is not None:
            yield from commands(found, (*path, name))


class CommandDirective(SphinxDirective):
    """Render the command whose full name is the argument, or all of a group: ``robotd sim``."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """Return usage, help text and options of each command that is found."""
        name = self.arguments[0]
        found = [item for item in commands() if f"{item[0]} ".startswith(f"{name} ")]
        if not found:
            raise self.error(f"no command is named {name!r}")
        DOCUMENTED.update(full for full, _ in found)
        return self.parse_text_to_nodes("\n\n".join(_text(*item) for item in found))


def _text(name: str, command: click.Command) -> str:
    """Return the usage, help text and table of options of a command."""
    context = click.Context(command, info_name=name)
    usage = " ".join(command.collect_usage_pieces(context))
    parts = [f"```text\n{name} {usage}\n```", _paragraphs(command.help)]
    rows = [_row(option, context) for option in command.get_params(context)]
    if shown := [row for row in rows if row]:
        parts.append(table(("option", "default", "meaning"), shown))
    return "\n\n".join(parts)


def _paragraphs(text: str | None) -> str:
    return "\n".join(line.strip() for line in (text or "").splitlines())


def _row(option: click.Parameter, context: click.Context) -> tuple[str, str, str] | None:
    if not isinstance(option, click.Option) or COMMON & {*option.opts}:
        return None
    names = " ".join(f"`{name}`" for name in option.opts)
    if not option.is_flag:
        metavar = option.metavar or option.type.name.upper()
        names = f"`{', '.join(option.opts)} {metavar}`"
    extra = option.get_help_extra(context)
    meaning = re.sub(r"(?<!\S)(--[a-z-]+)", r"`\1`", option.help or "")  # no dash: –set
    if "range" in extra:
        meaning += f" Range: {code(extra['range'])}."
    default = "required" if option.required else code(extra.get("default", ""))
    return names, default, meaning


def check_all_documented(app: Any, env: Any) -> None:
    """Warn about commands without a ``command`` directive."""
    for name in sorted({name for name, _ in commands()} - DOCUMENTED):
        log.warning("command %r is on no page: add a {command} directive", name)


def setup(app: Any) -> None:
    """Register the directive and the completeness check."""
    app.add_directive("command", CommandDirective)
    app.connect("env-check-consistency", check_all_documented)
