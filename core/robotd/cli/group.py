"""The top command: ``run`` where no command is named, plugins' commands, and errors' sentences."""

from __future__ import annotations

import traceback
from typing import Any

import click

from robotd.cli.exit_codes import ExitCode, exit_code
from robotd.cli.plugin_commands import plugin_command, plugin_commands
from robotd.errors import RobotdError

ROS_ARGS = "--ros-args"
DEFAULT = "run"
ROS_COMMANDS = (DEFAULT, "move", "gripper", "servo", "status", "sim")


class RobotdGroup(click.Group):
    """A click group that knows ROS arguments, a default command, plugins, and robotd's errors.

    What follows ``--ros-args`` is kept from click, for ``ros_args``.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        first_ros = args.index(ROS_ARGS) if ROS_ARGS in args else len(args)
        args, ctx.meta[ROS_ARGS] = args[:first_ros], args[first_ros:]
        if (args and self._is_option_of_run(ctx, args[0])) or (not args and ros_args(ctx)):
            args = [DEFAULT, *args]
        if ros_args(ctx) and args[0] not in ROS_COMMANDS:
            ctx.fail(f"{ROS_ARGS} belongs to {', '.join(ROS_COMMANDS)} only")
        return super().parse_args(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """A command of robotd or, where there is none of that name, of a plugin."""
        return super().get_command(ctx, cmd_name) or plugin_command(cmd_name)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_commands(ctx, formatter)
        if rows := plugin_commands():
            with formatter.section("Commands of plugins"):
                formatter.write_dl(rows)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt:
            ctx.exit(ExitCode.INTERRUPTED)
        except Exception as error:  # noqa: BLE001 - the user gets a sentence, never a traceback
            _tell(error, debug=ctx.meta.get("log_level") == "debug")
            ctx.exit(exit_code(error))

    def _is_option_of_run(self, ctx: click.Context, word: str) -> bool:
        own = {name for option in self.get_params(ctx) for name in option.opts}
        return word.startswith("-") and word.partition("=")[0] not in own


def ros_args(ctx: click.Context) -> list[str]:
    """The command line from ``--ros-args`` on, as it was typed; empty where there is none."""
    return list(ctx.meta[ROS_ARGS])


def _tell(error: Exception, *, debug: bool) -> None:
    if debug:
        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    text = str(error)
    if not isinstance(error, RobotdError):
        text = f"internal error: {type(error).__name__}: {error}"
        if not debug:
            text += "\nplease report it, with the output of --log-level debug"
    heading = click.style("robotd: error:", fg="red", bold=True)
    click.echo(f"{heading} {text}", err=True)
