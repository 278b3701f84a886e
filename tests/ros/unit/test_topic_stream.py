"""A topic opens another stream after one that could not be opened."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
from structlog.testing import capture_logs

from robotd.control.groups.streams import StreamClient
from robotd.errors import NotReady, OperationError
from robotd_ros.nodes.topic_stream import TopicStream


class Host:
    """Stand-in for the workers of a process: runs a call at once, or rejects it."""

    def __init__(self) -> None:
        self.is_full = False
        self.rejections: list[str] = []

    def on_rejection(self, topic: str, axes: Sequence[int], reason: str) -> None:
        self.rejections.append(reason)

    def submit(self, function: Callable[[], None], *, until_rest: bool) -> None:
        if self.is_full:
            raise OperationError("64 calls are waiting already")
        function()


class Stream(nullcontext[Any]):
    """Stand-in for an open stream, which ends at once."""

    def __init__(self, *, fails: bool = False) -> None:
        super().__init__(self)
        self.commands: list[str] = []
        self._fails = fails

    def put(self, command: str) -> None:
        if self._fails:
            raise ZeroDivisionError
        self.commands.append(command)

    def wait(self) -> None:
        pass


def client(open_stream: Callable[[], Any]) -> Any:
    admit = SimpleNamespace(admit=lambda *, moves: None)
    commands: Any = SimpleNamespace(source=admit, check_opening=lambda command: None)
    return StreamClient(commands, open_stream)


def command(commands: Any) -> str:
    return "command"


def test_a_message_while_all_workers_are_busy_does_not_block_the_topic() -> None:
    opened: list[Stream] = []

    def open_stream() -> Any:
        opened.append(Stream())
        return opened[-1]

    host: Any = Host()
    topic: Any = TopicStream(client(open_stream), host, "positions")
    host.is_full = True
    topic.apply(command)
    assert not opened
    host.is_full = False
    topic.apply(command)
    assert [stream.commands for stream in opened] == [["command"]]


@pytest.mark.parametrize("fails", ["opening", "command"])
def test_an_unexpected_error_does_not_block_the_topic(fails: str) -> None:
    opened: list[Stream] = []

    def open_stream() -> Any:
        opened.append(Stream(fails=fails == "command" and not opened))
        if fails == "opening" and len(opened) == 1:
            raise ZeroDivisionError
        return opened[-1]

    host: Any = Host()
    topic: Any = TopicStream(client(open_stream), host, "positions")
    with pytest.raises(ZeroDivisionError):
        topic.apply(command)
    topic.apply(command)
    assert opened[-1].commands == ["command"]


def test_no_stream_is_opened_for_a_command_that_is_rejected() -> None:
    opened: list[Stream] = []

    def reject(commands: Any) -> None:
        raise NotReady("the client has to begin anew")

    def open_stream() -> Any:
        opened.append(Stream())
        return opened[-1]

    host: Any = Host()
    topic: Any = TopicStream(client(open_stream), host, "positions")
    with capture_logs() as logs:
        for _ in range(3):
            topic.apply(reject)
    assert not opened
    assert [log["reason"] for log in logs] == ["the client has to begin anew"]


def test_the_command_that_opens_a_stream_is_not_put_after_a_newer_one() -> None:
    newer = threading.Thread(target=lambda: topic.apply(lambda commands: "newer"))

    class Slow(Stream):
        def put(self, command: str) -> None:
            if command == "command":  # the executor gets the next message meanwhile
                newer.start()
                newer.join(0.2)
            super().put(command)

        def wait(self) -> None:
            newer.join()

    stream, host = Slow(), Host()
    topic: Any = TopicStream(client(lambda: stream), host, "positions")  # type: ignore[arg-type]
    topic.apply(command)
    assert stream.commands == ["command", "newer"]
