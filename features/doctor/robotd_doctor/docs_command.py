"""``robotd docs``: the documentation of this version, in the terminal."""

from __future__ import annotations

import re
import sys
from importlib.metadata import files
from pathlib import Path

import click
from click.shell_completion import CompletionItem
from rich.console import Console
from rich.markdown import Markdown

import robotd
from robotd.api import InvalidArgument, unknown_name
from robotd.api.commands import columns, heading
from robotd_doctor.model_tables import model_keys
from robotd_doctor.python_help import with_help

PARTS = ("tutorial", "how-to", "reference", "explanation")
CLONE = Path(robotd.__file__).parents[2] / "docs"


# A table that the site makes from the code: name of the directive, its argument, its options.
GENERATED = re.compile(r"^:::\{([a-z-]+)\} *(\S.*)?\n((?::\w+: .*\n)*):::$", re.MULTILINE)


def pages() -> dict[str, Path]:
    """Return the files of the pages by name, as ``how-to/wmx``; those of a clone come first."""
    if (CLONE / "conf.py").is_file():
        found = [path for part in PARTS for path in (CLONE / part).glob("*.md")]
    else:
        installed = (Path(str(file.locate())) for file in files("robotd") or ())
        found = [path.resolve() for path in installed if path.match("share/doc/robotd/*/*.md")]
    found.sort(key=lambda path: (PARTS.index(path.parent.name), path.stem))
    return {f"{path.parent.name}/{path.stem}": path for path in found}


def _complete_pages(
    context: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    return [CompletionItem(name) for name in pages() if name.startswith(incomplete)]


@click.command("docs")
@click.argument("page", required=False, shell_complete=_complete_pages)
def docs(page: str | None) -> None:
    """Print a page of the documentation, or list all pages.

    Example: robotd docs how-to/operate. In a terminal it opens in the pager.
    """
    known = pages()
    if page is None:
        for part in PARTS:
            click.echo(heading(part))
            of_part = {name: path for name, path in known.items() if name.startswith(part)}
            rows = [("", name, _title(path)) for name, path in of_part.items()]
            click.echo("\n".join(columns(rows)))
        return
    name = page.removeprefix("docs/").removesuffix(".md")
    if name not in known:
        raise InvalidArgument(unknown_name("page", name, known))
    text = with_help(GENERATED.sub(_generated, known[name].read_text(encoding="utf-8")))
    if not sys.stdout.isatty():
        click.echo(text, nl=False)
        return
    console = Console(width=min(100, Console().width))
    with console.capture() as rendered:
        console.print(Markdown(text))
    click.echo_via_pager(rendered.get())


def _generated(found: re.Match[str]) -> str:
    kind, argument, options = found.groups()
    if kind == "model-keys":
        pairs = (line[1:].split(": ", 1) for line in options.splitlines())
        return model_keys(argument, {key: value.strip('"') for key, value in pairs})
    if kind == "command":
        return f"`{argument} --help` prints its options."
    return f"(The table of {argument or kind} is on the site: `make docs` in a clone builds it.)"


def _title(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    return next((line.removeprefix("# ") for line in lines if line.startswith("# ")), "")
