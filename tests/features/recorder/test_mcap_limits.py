"""Recordings that are decompression bombs: rejected before they take memory."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from tests.features.recorder.frames import ramp, write

from robotd.cli.exit_codes import ExitCode
from robotd.errors import RecordingError
from robotd_recording import mcap_records
from robotd_recording.recording_reader import read_recording
from robotd_recording.recording_repair import recover

MIB = 2**20
CHUNK, MAGIC = 6, 8
SAID_MIB = 1024  # content of a bomb of 100 kB
MAX_MEMORY_MIB = 400  # of a command, which takes 80 without a bomb

Compress = Callable[[int], bytes]


def zstd(size: int) -> bytes:
    """Zeros as one frame that states its size."""
    return zstandard.ZstdCompressor(level=1).compress(bytes(size))


def zstd_of_unknown_size(size: int) -> bytes:
    compressor = zstandard.ZstdCompressor(level=1, write_content_size=False)
    return compressor.compress(bytes(size))


def lz4_frame(size: int) -> bytes:
    return bytes(lz4.frame.compress(bytes(size)))


def with_chunks(path: Path, compression: str, chunks: Sequence[tuple[int, bytes]]) -> Path:
    """Put chunks, each with the size that it states, in front of those of a recording."""
    write(path, ramp())
    data = path.read_bytes()
    (header_size,) = struct.unpack_from("<Q", data, MAGIC + 1)
    begin = MAGIC + 9 + header_size
    word = compression.encode()
    bombs = b""
    for said, content in chunks:
        fields = struct.pack("<QQQII", 0, 0, said, 0, len(word)) + word
        fields += struct.pack("<Q", len(content)) + content
        bombs += struct.pack("<BQ", CHUNK, len(fields)) + fields
    path.write_bytes(data[:begin] + bombs + data[begin:])
    return path


# A process begins with the memory of the one that starts it: not with that of the tests.
MEASURED = (
    "import resource, subprocess, sys; status = subprocess.run(sys.argv[1:]).returncode;"
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss); sys.exit(status)"
)


@pytest.mark.parametrize("command", ["explain", "record --recover", "sim run --from"])
def test_a_bomb_takes_no_memory(tmp_path: Path, command: str) -> None:
    size = SAID_MIB * MIB
    bomb = with_chunks(tmp_path / "bomb.mcap", "zstd", [(size, zstd(size))])
    words = [sys.executable, "-m", "robotd", *command.split(), str(bomb)]
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == ExitCode.CONFIGURATION, done.stderr
    assert f"{bomb}: a chunk of {SAID_MIB} MiB, the limit is 64 MiB" in done.stderr
    assert int(done.stdout.split()[-1]) / 1024 < MAX_MEMORY_MIB


@pytest.mark.parametrize(
    ("compression", "compress"),
    [
        ("zstd", zstd),
        ("zstd", zstd_of_unknown_size),
        ("lz4", lambda n: lz4.frame.compress(bytes(n))),
    ],
)
def test_a_chunk_that_lies_about_its_size_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compression: str, compress: Compress
) -> None:
    taken: list[int] = []
    decompress = mcap_records._decompress

    def watched(chunk: object) -> bytes:
        data = decompress(chunk)  # type: ignore[arg-type]
        taken.append(len(data))
        return data

    monkeypatch.setattr(mcap_records, "_decompress", watched)
    bomb = with_chunks(tmp_path / "bomb.mcap", compression, [(1000, compress(300 * MIB))])
    with pytest.raises(RecordingError, match="a chunk of 1001 bytes instead of 1000"):
        read_recording(bomb)
    with pytest.raises(RecordingError, match="no complete chunk"):
        recover(bomb)
    assert max(taken) == 1001


def test_many_chunks_are_limited_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_records, "MAX_CONTENT_BYTES", 4 * MIB)
    size = 9 * 2**17  # zeros are empty records of nine bytes
    chunk = (size, zstd(size))
    bomb = with_chunks(tmp_path / "bomb.mcap", "zstd", [chunk] * 5)
    for read in (read_recording, recover):
        with pytest.raises(RecordingError, match="more than 4 MiB when decompressed"):
            read(bomb)
    assert [path.name for path in tmp_path.iterdir()] == ["bomb.mcap"]


@pytest.mark.parametrize("length", [2**30, 2**62, 2**64 - 1])
def test_a_record_that_is_longer_than_the_limit_is_named(tmp_path: Path, length: int) -> None:
    path = tmp_path / "long.mcap"
    write(path, ramp())
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, MAGIC + 1, length)
    path.write_bytes(data)
    for read in (read_recording, recover):
        with pytest.raises(RecordingError, match=f"{length}"):
            read(path)


def test_messages_of_lz4_chunks_are_read(tmp_path: Path) -> None:
    path = tmp_path / "foreign.mcap"
    with_chunks(path, "lz4", [(0, lz4_frame(0))])
    assert len(read_recording(path).frames) == 100
