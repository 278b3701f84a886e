"""Top-level click group: default command, lazy loading, plugins, and error reporting."""

from __future__ import annotations

import errno
import gc
import os
import sys
import traceback
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import click
from click.shell_completion import CompletionItem

from robotd.cli.exit_codes import ExitCode, exit_code
from robotd.cli.plugin_commands import COMMANDS, plugin_command, plugin_commands
from robotd.cli.shell_values import installed_robots
from robotd.entry_points import installed_names
from robotd.errors import PluginError, RobotdError, did_you_mean, plugin_failure
from robotd.stop_signals import ended_by_interrupt

ROS_ARGS = "--ros-args"
STATUS = "exit status"  # in the ``meta`` of the context, for what is closed at the end
DEFAULT = "run"
LONGEST_SUMMARY = 400  # characters
WORDS = {  # of other programs
    "help": "robotd --help lists the commands, robotd COMMAND --help explains one",
    "start": "robotd run --robot NAME serves a robot",
    "launch": "robotd run --robot NAME serves a robot",
    "ls": "robotd robots lists the robots that can be run, robotd list those that run",
}
UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EIO)  # full disk or quota, lost terminal


class RobotdGroup(click.Group):
    """Click group with ROS arguments, a default command, plugins, and robotd's errors.

    Arguments after ``--ros-args`` are hidden from click; ``ros_args`` returns them. A command
    takes them if its epilog, the last line of its help, says so.
    """

    def main(self, *args: Any, **options: Any) -> Any:
        try:
            return super().main(*args, **options)
        except OSError as error:  # of the output of --help or --version
            _report(error, debug=False)
            sys.exit(ExitCode.FAILED)
        finally:
            _drop_unwritable_output()

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        first_ros = args.index(ROS_ARGS) if ROS_ARGS in args else len(args)
        args, ctx.meta[ROS_ARGS] = args[:first_ros], args[first_ros:]
        _reject_empty(ctx, args)
        has_ros_args = bool(ctx.meta[ROS_ARGS])
        if (args and self._is_option_of_run(ctx, args[0])) or (not args and has_ros_args):
            args = [DEFAULT, *args]
        if has_ros_args:
            command = self.get_command(ctx, args[0])
            if command is not None and ROS_ARGS not in (command.epilog or ""):
                ctx.fail(f"{args[0]} takes no {ROS_ARGS}")
        return super().parse_args(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        # Imported objects stay: a collection would only cost time, 60 ms of `robotd run`, which
        # enables it when the robot has started.
        gc.disable()
        try:
            with ended_by_interrupt():
                command = plugin_command(cmd_name)
            if isinstance(command, click.Group):
                _summarize(command)
            return command
        finally:
            if cmd_name != DEFAULT:
                gc.enable()

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if not ctx.resilient_parsing and self.get_command(ctx, args[0]) is None:
            ctx.fail(f"No such command {args[0]!r}{self._hint(ctx, args[0]) or '.'}")
        return super().resolve_command(ctx, args)

    def _hint(self, ctx: click.Context, word: str) -> str:
        """Return what is meant by a word that is not a command."""
        if word in WORDS:
            return f"; {WORDS[word]}"
        if word in installed_robots():
            return f"; it is a robot: robotd run --robot {word}"
        return did_you_mean(word, self.list_commands(ctx))

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [command.name for command in plugin_commands()]

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return commands and options; click would import the commands."""
        listed = (command for command in plugin_commands() if command.name.startswith(incomplete))
        commands = [CompletionItem(command.name, help=command.summary) for command in listed]
        return [*commands, *click.Command.shell_complete(self, ctx, incomplete)]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        listed = groupby(plugin_commands(), lambda command: command.heading)
        for heading, commands in listed:
            with formatter.section(heading):
                formatter.write_dl([(command.name, command.summary) for command in commands])

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; the ``ExitCode`` that it returns, if any, is the exit status."""
        try:
            status = super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError) as error:
            ctx.meta[STATUS] = getattr(error, "exit_code", ExitCode.FAILED)
            raise  # click ends quietly when the reader of the output is gone
        except KeyboardInterrupt:
            status = ExitCode.INTERRUPTED
        except Exception as error:  # noqa: BLE001 - reported as one line, never as a traceback
            named = _named(ctx.invoked_subcommand or "", error)
            _report(named, debug=ctx.meta.get("log_level") == "debug")
            status = exit_code(named)
        if isinstance(status, ExitCode):
            ctx.meta[STATUS] = status
            ctx.exit(status)

    def _is_option_of_run(self, ctx: click.Context, word: str) -> bool:
        own = {name for option in self.get_params(ctx) for name in option.opts}
        return word.startswith("-") and word.partition("=")[0] not in own


def _summarize(group: click.Group) -> None:
    """Let the help of a group have the whole first sentence of each command.

    click cuts it to the width of the line; a ``short_help`` is wrapped.
    """
    for command in group.commands.values():
        command.short_help = command.get_short_help_str(LONGEST_SUMMARY)
        if isinstance(command, click.Group):
            _summarize(command)


def ros_args() -> list[str]:
    """Return the arguments from ``--ros-args`` on, as typed; empty without it. In a command."""
    return list(click.get_current_context().meta[ROS_ARGS])


def _reject_empty(ctx: click.Context, words: Sequence[str]) -> None:
    """Fail where a word is empty, as from an unset variable of a shell.

    Commands would take it for one that is not given. What follows ``--`` is left to them.
    """
    own = words[: words.index("--")] if "--" in words else words
    for before, word in zip(("robotd", *own), own, strict=False):
        name, equals, value = word.partition("=")
        if not word:
            ctx.fail(f"the word after {before!r} is empty")
        if name.startswith("--") and equals and not value:
            ctx.fail(f"{name!r} has an empty value")


def _drop_unwritable_output() -> None:
    """Drop output that a lost terminal did not take.

    The interpreter would try to write it once more at its end, and exit with status 120 instead of
    the command's own.
    """
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


def _is_unwritable(error: Exception) -> bool:
    """Return whether the output cannot be written: a full disk, or a lost terminal."""
    return isinstance(error, OSError) and error.errno in UNWRITABLE and error.filename is None


def _named(command: str, error: Exception) -> Exception:
    """Return the error of a command, with the plugin that it belongs to."""
    if isinstance(error, RobotdError) or _is_unwritable(error):
        return error
    found = installed_names(COMMANDS).entries.get(command)
    if found is None or found[0].is_own:
        return error
    what = f"command {found[0]} failed: {plugin_failure(error, found[0].module)}"
    named = PluginError(f"{what}\nplease report it to the authors of {found[0].release}")
    named.__cause__ = error
    return named


def _report(error: Exception, *, debug: bool) -> None:
    if debug:
        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    from robotd.log import escaped  # not for --help: it takes a third of a second

    text = escaped(str(error))
    if _is_unwritable(error):
        text = f"the output cannot be written: {getattr(error, 'strerror', '')}"
    elif not isinstance(error, RobotdError):
        text = f"internal error: {type(error).__name__}: {error}"
        if not debug:
            text += "\nplease report it, with the output of --log-level debug"
    heading = click.style("robotd: error:", fg="red", bold=True)
    click.echo(f"{heading} {text}", err=True)
