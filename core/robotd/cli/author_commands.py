"""Commands for authors of backends: ``conform`` and ``new-backend``."""

from __future__ import annotations

from pathlib import Path

import click

from robotd.cli.options import configure_logging, log_options


@click.command("conform", epilog="What follows -- goes to pytest: robotd conform ... -- -x --pdb")
@click.option("--backend", metavar="NAME", required=True, help="The backend to check.")
@click.option("--robot", metavar="NAME|FILE", help="The robot that it drives; by default a bench.")
@click.option(
    "--junit",
    metavar="FILE",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the results there too, as JUnit XML.",
)
@click.option("-k", "expression", metavar="EXPR", help="Only checks whose names match.")
@click.argument("pytest_arguments", metavar="[-- ARG...]", nargs=-1, type=click.UNPROCESSED)
@log_options
@click.pass_context
def conform(
    ctx: click.Context,
    /,
    backend: str,
    robot: str | None,
    junit: Path | None,
    expression: str | None,
    pytest_arguments: tuple[str, ...],
) -> None:
    """Run the conformance checks on a backend. Axes move."""
    from robotd.cli.conform import run_conformance

    configure_logging(ctx)
    ctx.exit(run_conformance(backend, robot, junit, expression, pytest_arguments))


@click.command("new-backend")
@click.argument("name")
@click.option(
    "--into",
    metavar="FOLDER",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path(),
    help="Where the package's folder is made; by default here.",
)
@log_options
@click.pass_context
def new_backend(ctx: click.Context, /, name: str, into: Path) -> None:
    """Write an installable backend package that passes the checks, to start from."""
    from robotd.cli.new_backend import write_backend

    configure_logging(ctx)
    write_backend(name, into)


AUTHOR_COMMANDS = (conform, new_backend)
