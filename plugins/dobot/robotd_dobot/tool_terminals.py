"""Digital terminals of the tool, which no feedback shows: they are asked for."""

from __future__ import annotations

from robotd.api import NANOSECONDS, NotReady, OperationError, get_logger
from robotd_dobot.command_port import CommandPort, Request
from robotd_dobot.protocol import Dialect, command, parse_reply

log = get_logger("dobot")

TERMINALS = 2  # inputs, and as many outputs
PERIOD_S = 0.1
TIMEOUT_S = 2.0  # for the replies


class ToolTerminals:
    """Levels of inputs and outputs; bit 0 is terminal 1. Any thread reads, one polls.

    They are 0 before the first answer, and while the controller rejects the queries, as it does
    in an alarm. A controller that cannot be asked for outputs has those of its last commands.
    """

    def __init__(self, port: CommandPort, dialect: Dialect) -> None:
        self.inputs = self.outputs = 0
        self._port, self._dialect = port, dialect
        self._asked_ns = 0
        self._queries: list[Request] = []
        self._rejection = ""

    def poll(self, now_ns: int) -> None:
        """Take the answers that are here, and ask again when it is time.

        Raises OSError: the connection has ended, or the controller does not answer.
        """
        if self._queries:
            if self._port.is_answered(self._queries[-1]):
                self._take([self._level(query) for query in self._queries])
                self._queries = []
            elif now_ns - self._asked_ns > TIMEOUT_S * NANOSECONDS:
                raise TimeoutError(f"{self._queries[0].name} without a reply")
        elif now_ns - self._asked_ns >= PERIOD_S * NANOSECONDS:
            self._asked_ns = now_ns
            names = filter(None, ("ToolDI", self._dialect.get_tool_output))
            self._queries = [
                self._port.post(command(name, terminal + 1))
                for name in names
                for terminal in range(TERMINALS)
            ]

    def note_output(self, terminal: int, level: bool) -> None:
        """Note a level that was set, where the controller cannot be asked for it."""
        if not self._dialect.get_tool_output:
            self.outputs = self.outputs & ~(1 << terminal) | level << terminal

    def _take(self, levels: list[bool]) -> None:
        self.inputs = sum(level << bit for bit, level in enumerate(levels[:TERMINALS]))
        if self._dialect.get_tool_output:
            self.outputs = sum(level << bit for bit, level in enumerate(levels[TERMINALS:]))

    def _level(self, query: Request) -> bool:
        try:
            level = parse_reply(query.reply or "", query.name).strip() == "1"
        except (NotReady, OperationError) as error:
            if self._rejection != str(error):
                self._rejection = str(error)
                log.warning("terminals of the tool cannot be read", reason=self._rejection)
            return False
        self._rejection = ""
        return level
