"""Repair of recordings that were not closed: copies all complete chunks to a new file."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from robotd.api import NANOSECONDS, RecordingError
from robotd_recording.recording_folder import PARTIAL
from robotd_recording.recording_writer import CHUNK_BYTES

DAMAGED = ".damaged"  # suffix of the original file


@dataclass(frozen=True)
class Repair:
    """Result of a repair.

    Attributes:
        damaged: path of the original file.
        messages: number of messages in the repaired file.
        duration_s: from the first to the last of the topic that has most of them: a recording
            begins with older lines of the log.
    """

    damaged: Path
    messages: int
    duration_s: float


def recover(path: Path) -> Repair | None:
    """Replace ``path`` by a repaired file, and keep the original under another name.

    Also for MCAP files of other programs. Returns None for a complete file, which is left as it
    is. Raises RecordingError: no message could be read, the file exceeds a limit, or one cannot be
    written; then ``path`` is unchanged.
    """
    partial = path.with_name(path.name + PARTIAL)
    damaged = path.with_name(path.name + DAMAGED)
    try:
        with path.open("rb") as source:
            if _is_complete(path, source):
                return None
            source.seek(0)
            with partial.open("wb") as target:
                topics = _copy(_records(path, source), target)
        if not topics:
            raise RecordingError(f"{path}: no complete chunk of messages in it")
        path.rename(damaged)
        partial.rename(path)
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error
    finally:
        partial.unlink(missing_ok=True)
    longest = max(topics, key=lambda topic: topic.messages)
    duration_s = (longest.last_ns - longest.first_ns) / NANOSECONDS
    return Repair(damaged, sum(topic.messages for topic in topics), duration_s)


@dataclass
class _Topic:
    """Number of messages of a topic, with the earliest and the latest time."""

    first_ns: int
    last_ns: int
    messages: int = 0

    def count(self, time_ns: int) -> None:
        self.first_ns, self.last_ns = min(self.first_ns, time_ns), max(self.last_ns, time_ns)
        self.messages += 1


def _copy(records: Iterator[Any], target: IO[bytes]) -> list[_Topic]:
    """Copy ``records``; return the topics that have messages."""
    from mcap.records import Attachment, Channel, Header, Message, Metadata, Schema
    from mcap.writer import CompressionType, Writer

    writer = Writer(target, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    schemas: dict[int, int] = {0: 0}
    channels: dict[int, int] = {}
    topics: dict[int, _Topic] = {}
    has_begun = False
    for record in records:
        match record:
            case Header() if not has_begun:
                writer.start(profile=record.profile, library=record.library)
                has_begun = True
            case Schema() if record.id not in schemas:
                schemas[record.id] = writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic,
                    record.message_encoding,
                    schemas[record.schema_id],
                    record.metadata,
                )
            case Message():
                writer.add_message(
                    channels[record.channel_id],
                    record.log_time,
                    record.data,
                    record.publish_time,
                    record.sequence,
                )
                time_ns = record.log_time
                topics.setdefault(record.channel_id, _Topic(time_ns, time_ns)).count(time_ns)
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case Attachment():
                writer.add_attachment(
                    record.create_time,
                    record.log_time,
                    record.name,
                    record.media_type,
                    record.data,
                )
    if has_begun:
        writer.finish()
    return list(topics.values())


def _is_complete(path: Path, source: IO[bytes]) -> bool:
    """Return True for a file without damage that was closed."""
    try:
        deque(_read(path, source), maxlen=0)
    except _Damage:
        return False
    return True


def _records(path: Path, source: IO[bytes]) -> Iterator[Any]:
    """Yield records up to the first that is cut off or damaged."""
    from mcap.records import DataEnd

    try:
        for record in _read(path, source):
            if isinstance(record, DataEnd):
                return  # the summary after it is written anew
            yield record
    except _Damage:
        return


class _Damage(Exception):
    """A record is cut off or damaged."""


def _read(path: Path, source: IO[bytes]) -> Iterator[Any]:
    """Yield all records. Raises _Damage, also where the end of the file is missing."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    from robotd_recording.mcap_records import read_records

    try:
        yield from read_records(path, source)
    except (
        McapError,
        ZstdError,
        struct.error,
        EOFError,
        ValueError,
        KeyError,
        RuntimeError,
    ) as error:  # RuntimeError: of lz4
        raise _Damage from error
