"""Records of an MCAP file one at a time, within limits of memory."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError, RecordLengthLimitExceeded
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader

from robotd.api import RecordingError

MIB = 2**20
MAX_RECORD_BYTES = 64 * MIB  # of a record in the file, and of a chunk when it is decompressed
MAX_CONTENT_BYTES = 256 * MIB  # of a file when it is decompressed, or:
MAX_EXPANSION = 100  # times its size; a recording of an arm at rest expands 8 times


def max_content_bytes(source: IO[bytes]) -> int:
    """Return how large the content of a file may be."""
    return max(MAX_CONTENT_BYTES, MAX_EXPANSION * os.fstat(source.fileno()).st_size)


def read_records(path: Path, source: IO[bytes]) -> Iterator[Any]:
    """Yield all records of ``source``; those of chunks instead of the chunks.

    Raises RecordingError, which names ``path``, beyond a limit. What mcap raises for damage is left
    to the caller: McapError, ValueError, KeyError, struct.error.
    """
    limit, total = max_content_bytes(source), 0
    reader = StreamReader(
        _BoundedReads(source),  # type: ignore[arg-type]
        emit_chunks=True,
        validate_crcs=True,
        record_size_limit=MAX_RECORD_BYTES,
    )
    try:
        for record in reader.records:
            if not isinstance(record, Chunk):
                yield record
                continue
            total += record.uncompressed_size
            if record.uncompressed_size > MAX_RECORD_BYTES:
                text = f"a chunk of {record.uncompressed_size / MIB:.0f} MiB, the limit is"
                raise RecordingError(f"{path}: {text} {MAX_RECORD_BYTES // MIB} MiB")
            if total > limit:
                raise RecordingError(f"{path}: more than {limit // MIB} MiB when decompressed")
            yield from _records_of(record)
    except RecordLengthLimitExceeded as error:
        raise RecordingError(f"{path}: {error}") from error


class _BoundedReads:
    """File whose reads are bounded: a length in a hostile file can be anything."""

    def __init__(self, source: IO[bytes]) -> None:
        self._source = source

    def read(self, size: int) -> bytes:
        if size < 0:
            raise ValueError(f"a length of {size}")
        return self._source.read(min(size, MAX_RECORD_BYTES))


def _records_of(chunk: Chunk) -> Iterator[Any]:
    data = _decompress(chunk)
    if len(data) != chunk.uncompressed_size:
        raise McapError(f"a chunk of {len(data)} bytes instead of {chunk.uncompressed_size}")
    if chunk.uncompressed_crc and (found := zlib.crc32(data)) != chunk.uncompressed_crc:
        raise CRCValidationError(chunk.uncompressed_crc, found, chunk)
    stream = ReadDataStream(BytesIO(data))
    while stream.count < len(data):
        opcode, length = stream.read1(), stream.read8()
        if opcode == Opcode.MESSAGE:
            yield Message.read(stream, length)
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(stream)
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(stream)
        else:
            stream.read(length)


def _decompress(chunk: Chunk) -> bytes:
    """Return the content of ``chunk``, at most one byte more than it says."""
    end = chunk.uncompressed_size + 1
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            return reader.read(end)
    if chunk.compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # only for files of other programs

        decompressor = LZ4FrameDecompressor()
        return bytes(decompressor.decompress(chunk.data, max_length=end))
    return chunk.data
