"""Panel of the page that another feature provides: its commands, held buttons and state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from pydantic import Field, TypeAdapter

from robotd_page import control_commands as commands
from robotd_page.control_drive import DriveBeat
from robotd_page.control_jog import JogBeat
from robotd_page.control_target import MoveTool, Reach
from robotd_page.control_tool import JogTool
from robotd_page.held_motion import Heartbeat, HeldMotion, Release

if TYPE_CHECKING:
    from robotd_page.control_commands import Command, Message

REQUESTS: Sequence[type[Message]] = (
    JogBeat,
    JogTool,
    MoveTool,
    Reach,
    DriveBeat,
    Release,
    commands.Stop,
    commands.Reset,
    commands.Recover,
    commands.SwitchServos,
    commands.Grip,
    commands.Speed,
    commands.Pause,
    commands.Output,
    commands.OutputBit,
    commands.OutputByte,
    commands.Inject,
)


class ControlPanel(Protocol):
    """Panel of the page, as another feature offers it: ``robotd_teach.page_panel.TeachPanel``.

    Attributes:
        commands: that it adds; the literal ``type`` of each is its own.
        holds: motion while a button is held, by its heartbeat.
    """

    commands: Sequence[type[Command]]
    holds: Mapping[type[Heartbeat], Callable[..., HeldMotion[Any]]]

    def describe(self) -> dict[str, Any]:
        """Return what does not change while the robot runs."""

    def state(self) -> dict[str, Any]:
        """Return the state by part; parts that differ are sent. Worker, several times a second."""


def requests_of(added: Iterable[type[Message]] = ()) -> TypeAdapter[Any]:
    """Return what validates the messages of a controller; ``added``: by a panel."""
    union: Any = reduce(or_, (*REQUESTS, *added))
    return TypeAdapter(Annotated[union, Field(discriminator="type")])
