"""SDO client of one node; errors name node, object and abort code.

A transfer without a response is repeated as a whole, never in parts, unless it may have an effect.
Responses to earlier requests are not taken for that of the present one.
"""

from __future__ import annotations

import struct
import threading
import time
from dataclasses import dataclass

import can
from canopen.objectdictionary import ObjectDictionary
from canopen.objectdictionary.datatypes import SIGNED_TYPES
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from robotd.api import DeviceTimeout, MonotonicClock, OperationError, wait_until
from robotd_canopen.bus import Bus
from robotd_canopen.object_dictionary import describe, variable
from robotd_cia402.drive_access import SdoAbort
from robotd_cia402.start_pace import StartPace

_REQUEST, _RESPONSE = 0x600, 0x580
_COMMAND = 0xE0  # bits of the first byte; the three bytes that follow an initiate name the object
_INITIATES = (0x20, 0x40)  # download and upload
_ABORT = 0x80
_ANSWERS_TO_INITIATE = (0x60, 0x40, _ABORT)
_MAX_WAIT_S = 2.0  # for answers that come after the time-out
_LATE_RESPONSE_S = 2.0  # after a request, for the answer of another node with the same id
_ANSWER_OF = {0x20: 0x60, 0x40: 0x40}  # to each initiate


class Sdo:
    """SDO client of one node. Any worker thread; transfers of one node follow each other.

    Attributes:
        pace: of the start that configures the node.
        doubled: an object was answered more often than it was requested, so that several nodes
            have this id; stays.

    Args:
        path: the node's name in error texts, ``can0 → joint2 (node 3)``.
        timeout_s: for each answer.
        tries: transfers that are tried before DeviceTimeout is raised.
    """

    def __init__(
        self,
        bus: Bus,
        node: int,
        path: str,
        dictionary: ObjectDictionary,
        timeout_s: float = 0.3,
        tries: int = 3,
    ) -> None:
        self.dictionary = dictionary
        self.doubled = False
        self._answers: dict[bytes, _Answers] = {}  # by index and subindex
        self._awaited = (0, b"")  # answer to the present request, and its index and subindex
        self._clock = MonotonicClock()
        self.pace = StartPace(self._clock)
        self._bus = bus
        self._path = path
        self._tries = tries
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        requests, responses = _REQUEST + node, _RESPONSE + node
        self._client = SdoClient(requests, responses, dictionary)  # type: ignore[no-untyped-call]
        self._client.network = self  # type: ignore[assignment] # all it needs is send_message
        self._client.RESPONSE_TIMEOUT = timeout_s
        bus.subscribe(_RESPONSE + node, self._on_response)

    def upload(self, index: int, sub: int = 0) -> bytes:
        """The raw value. Raises SdoAbort, DeviceTimeout, OperationError."""
        return self._transfer("reading", index, sub, None, self._tries)

    def download(self, index: int, sub: int, data: bytes, *, retry: bool = False) -> None:
        """Write the raw value. Raises SdoAbort, DeviceTimeout, OperationError.

        Args:
            retry: repeat it where no answer comes. The node may have executed it all the same,
                and a command such as a store takes seconds: only for values.
        """
        self._transfer("writing", index, sub, data, self._tries if retry else 1)

    def read(self, index: int, sub: int = 0) -> int:
        """Read an integer, signed if its type in the dictionary is."""
        found = variable(self.dictionary, index, sub)
        signed = found is not None and found.data_type in SIGNED_TYPES
        return int.from_bytes(self.upload(index, sub), "little", signed=signed)

    def write(self, index: int, sub: int, value: int, *, retry: bool = True) -> None:
        """Write an integer of its size in the dictionary (4 bytes for an unknown object).

        ``retry``: see ``download``.
        """
        found = variable(self.dictionary, index, sub)
        size = len(found) // 8 if found is not None else 4
        limit = 1 << 8 * size
        if not -limit // 2 <= value < limit:
            where = describe(self.dictionary, index, sub)
            raise OperationError(
                f"{self._path}: {where}: value {value} does not fit in {size} bytes"
            )
        self.download(index, sub, (value % limit).to_bytes(size, "little"), retry=retry)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a request frame of the library's client. Raises can.CanOperationError."""
        command = data[0] & _COMMAND
        if command in _INITIATES:
            key = bytes(data[1:4])
            answers = self._answers.setdefault(key, _Answers())
            answers.missing += 1
            answers.requested_s = time.monotonic()
            self._awaited = _ANSWER_OF[command], key
        self._bus.send_message(can_id, data, remote)

    def _transfer(self, verb: str, index: int, sub: int, data: bytes | None, tries: int) -> bytes:
        where = f"{self._path}: {verb} {describe(self.dictionary, index, sub)}"
        reason = ""
        with self._lock:
            answers = self._answers.setdefault(_key(index, sub), _Answers())
            missing, begin_s = answers.missing, time.monotonic()
            for _ in range(tries):
                self.pace.note_transfer(where)
                try:
                    read = self._transfer_once(index, sub, data)
                except SdoAbortedError as error:
                    self._require_pace(where, answers, missing, begin_s, answered=True)
                    text = SdoAbortedError.CODES.get(error.code, "unknown abort code")
                    message = f"{where}: abort 0x{error.code:08X}, {text.lower()}"
                    raise SdoAbort(message, error.code) from error
                except (SdoCommunicationError, struct.error, can.CanError) as error:
                    reason = str(error)
                except Exception as error:
                    # The library does not validate responses: a corrupt one may raise anything.
                    raise OperationError(f"{where}: corrupt answer: {error}") from error
                else:
                    self._require_pace(where, answers, missing, begin_s, answered=True)
                    return read
            if "No SDO response" in reason:
                self._require_pace(where, answers, missing, begin_s, answered=False)
        if "No SDO response" in reason:
            after = f"{tries} tries" if tries > 1 else "not repeated"
            acted = "" if data is None else "; it may have been executed, read the object back"
            hint = acted if tries == 1 else ""
            raise DeviceTimeout(f"{where}: no answer within {self._timeout_s:g} s, {after}{hint}")
        raise OperationError(f"{where}: {reason}")

    def _transfer_once(self, index: int, sub: int, data: bytes | None) -> bytes:
        """Read, or write ``data``; return what was read."""
        if data is None:
            return bytes(self._client.upload(index, sub))
        self._client.download(index, sub, data)
        return b""

    def _require_pace(
        self, where: str, answers: _Answers, missing: int, begin_s: float, *, answered: bool
    ) -> None:
        """Wait for answers that are still to come. Raises DeviceTimeout if they are late.

        A late answer would be taken for that to the next request for the same object. One that
        was lost never comes, and shows nothing.

        Args:
            missing: answers to earlier transfers of the object that have not come.
            begin_s: time of the first request.
            answered: one answer has come in time for the last request, or seemed to.
        """
        goal = missing if answered else answers.missing - 1
        span_s = answers.requested_s - begin_s if answered else 0.0
        limit_s = min(span_s + self._timeout_s, _MAX_WAIT_S)
        if answers.missing <= goal or not wait_until(
            lambda: answers.missing <= goal, limit_s, self._clock
        ):
            return
        took_s = answers.answered_s - (answers.requested_s if answered else begin_s)
        if took_s > self._timeout_s:
            raise DeviceTimeout(
                f"{where}: no answer within {self._timeout_s:g} s, it came after {took_s:.2f} s:"
                " raise sdo_timeout_s (--timeout on the command line)"
            )

    def _on_response(self, data: bytearray) -> None:
        if len(data) != 8:
            raise ValueError(f"an SDO answer has 8 bytes, this one {len(data)}")
        command, key = data[0] & _COMMAND, bytes(data[1:4])
        if command in _ANSWERS_TO_INITIATE:
            self._count(key, is_abort=command == _ABORT)
            if not self._is_awaited(command, key):
                return  # to an earlier request
        self._client.on_response(0, data, 0.0)  # type: ignore[no-untyped-call]

    def _is_awaited(self, command: int, key: bytes) -> bool:
        """Return False for an answer to another request; some nodes abort without an index."""
        if command == _ABORT:
            return key == self._awaited[1] or key not in self._answers
        return (command, key) == self._awaited

    def _count(self, key: bytes, *, is_abort: bool) -> None:
        """Count an answer for the object ``key``; one too many comes from another node.

        Answers to requests that another client on the bus has sent do not count, except within
        ``_LATE_RESPONSE_S`` of a request for the same object.
        """
        answers = self._answers.get(key)
        if answers is None or time.monotonic() - answers.requested_s > _LATE_RESPONSE_S:
            return
        answers.answered_s = time.monotonic()
        if answers.missing:
            answers.missing -= 1
        elif not is_abort:  # a node may also abort the segments that follow its answer
            self.doubled = True


@dataclass(slots=True)
class _Answers:
    """Unanswered requests for one object, and the times of the last request and answer."""

    missing: int = 0
    requested_s: float = 0.0
    answered_s: float = 0.0


def _key(index: int, sub: int) -> bytes:
    """Bytes 1 to 3 of a frame that initiates a transfer or answers to it."""
    return struct.pack("<HB", index, sub)
