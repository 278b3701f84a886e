"""Commands that read and write objects of a node, without a running robot."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol

import click

from robotd.api import IntegerRange, ObjectNumber

# Other commands must not load a fieldbus library: no more is imported at module level.

Command = Callable[..., Any]


class Objects(Protocol):
    """SDO transfers with one node."""

    def upload(self, index: int, sub: int = 0) -> bytes: ...

    def download(self, index: int, sub: int, data: bytes) -> None: ...


def object_commands(
    kind: str,
    ids: IntegerRange,
    bus_options: Callable[[Command], Command],
    open_node: Callable[..., AbstractContextManager[Objects]],
) -> click.Group:
    """Return the group ``sdo``.

    Args:
        kind: of the nodes, "slave"; also the name of the argument.
        open_node: called with the bus options and the node, by name.
    """
    node = click.argument(kind, type=ids)

    @click.group(
        help=f"Read and write objects of a {kind}, without a running robot ('robotd sdo')."
    )
    def sdo() -> None:
        pass

    @sdo.command(
        help=f"Print object INDEX:SUB of {kind.upper()}: raw bytes, as a number, and as text."
    )
    @bus_options
    @node
    @click.argument("index", type=ObjectNumber())
    @click.argument("sub", type=ObjectNumber(), default=0)
    def read(index: int, sub: int, **options: Any) -> None:
        from robotd.api import object_text

        with open_node(**options) as objects:
            click.echo(object_text(objects.upload(index, sub)))

    @sdo.command(
        context_settings={"ignore_unknown_options": True},  # -5 is a value
        help=f"Write VALUE to object INDEX:SUB of {kind.upper()}, and print the value read back."
        "\n\nIt is sent once: without an answer it may have been executed.",
    )
    @bus_options
    @node
    @click.argument("index", type=ObjectNumber())
    @click.argument("sub", type=ObjectNumber())
    @click.argument("value", type=ObjectNumber())
    @click.option("--size", type=IntegerRange(1, 8), help="Bytes; by default as long as it reads.")
    def write(index: int, sub: int, value: int, size: int | None, **options: Any) -> None:
        from robotd.api import object_bytes, object_text

        with open_node(**options) as objects:
            length = size or len(objects.upload(index, sub))
            objects.download(index, sub, object_bytes(value, length))
            click.echo(object_text(objects.upload(index, sub)))

    return sdo
