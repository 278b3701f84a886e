"""``python -m tools.fuzz --minutes 20``: bad files for every reader, findings kept as files."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from random import SystemRandom
from tempfile import TemporaryDirectory

import click
from tools.fuzz.campaign import FuzzFailure, make_input, run, try_input
from tools.fuzz.readers import READERS

NAMES = [reader.name for reader in READERS]


@click.command()
@click.option("--minutes", default=1.0, show_default=True, help="How long.")
@click.option("--seed", type=int, help="Of the inputs; a random one is chosen and printed.")
@click.option("--reader", "names", multiple=True, type=click.Choice(NAMES), help="Only these.")
@click.option("--index", type=int, help="One input only, as a finding names it.")
@click.option(
    "--out",
    default=Path("fuzz-findings"),
    show_default=True,
    type=click.Path(path_type=Path),
    help="Folder for the inputs that were found.",
)
def main(
    minutes: float, seed: int | None, names: tuple[str, ...], index: int | None, out: Path
) -> None:
    """Give every reader of files bad ones. The status is 1 when one is not rejected in order.

    In order means: by an error of robotd that names the file, within 2 s of the processor and
    200 MB, without a hang or a crash.
    """
    seed = SystemRandom().randrange(10**9) if seed is None else seed
    chosen = list(names) or NAMES
    click.echo(f"seed {seed}, readers {', '.join(chosen)}")
    begin_s = time.monotonic()
    found: dict[str, FuzzFailure] = {}
    counts: dict[str, int] = {}
    for item in _one(seed, index, chosen) if index is not None else run(seed, minutes * 60, chosen):
        if isinstance(item, dict):
            counts = item
            _progress(counts, found, begin_s)
        elif found.setdefault(item.kind, item) is item:
            _keep(item, seed, out)
    click.echo(f"\n{_summary(counts, found, begin_s)}")
    sys.exit(bool(found))


def _one(seed: int, index: int, names: list[str]) -> Iterator[FuzzFailure | dict[str, int]]:
    with TemporaryDirectory(prefix="robotd-fuzz-") as folder:
        for reader in READERS:
            data = make_input(reader, seed, index)
            if reader.name in names and (text := try_input(reader, data, Path(folder))):
                yield FuzzFailure(reader.name, index, text, data)
    yield dict.fromkeys(names, 1)


def _keep(finding: FuzzFailure, seed: int, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"{finding.reader}-{seed}-{finding.index}"
    path.write_bytes(finding.data)
    click.echo(f"\n{path} (--seed {seed} --reader {finding.reader} --index {finding.index})")
    click.echo(finding.text)


def _summary(counts: dict[str, int], found: dict[str, FuzzFailure], begin_s: float) -> str:
    each = ", ".join(f"{name} {count}" for name, count in counts.items())
    passed_s = time.monotonic() - begin_s
    return f"{passed_s:.0f} s, {sum(counts.values())} inputs ({each}), {len(found)} findings"


def _progress(counts: dict[str, int], found: dict[str, FuzzFailure], begin_s: float) -> None:
    if sys.stdout.isatty():
        click.echo(f"\r{_summary(counts, found, begin_s)}", nl=False)


if __name__ == "__main__":
    main()
