"""Inputs one after the other, each within bounds of time and memory, in a process of its own."""

from __future__ import annotations

import logging
import multiprocessing
import resource
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from tools.fuzz.mutations import amplify, mutate_bytes
from tools.fuzz.readers import READERS, ROOT, Reader

CPU_S = 2.0  # of one input
HANG_S = 30.0  # real time without a sign of life; above the CPU bound on a machine with a load
MEMORY_BYTES = 200_000_000  # above what the process has before the first input
LONGEST = 40_000  # bytes of a seed that is changed byte by byte; a longer one loses its middle


@dataclass(frozen=True)
class FuzzFailure:
    """An input that was not read as it should be; ``data`` is the whole of it."""

    reader: str
    index: int
    text: str
    data: bytes

    @property
    def kind(self) -> str:
        """Two findings of one kind have one cause, most likely."""
        return f"{self.reader}: {self.text.strip().splitlines()[-1][:60]}"


def make_input(reader: Reader, seed: int, index: int) -> bytes:
    """Input number ``index``: the same for the same seed, on any machine."""
    random = Random(f"{seed}:{reader.name}:{index}")
    if random.random() < 0.3:
        data = reader.generate(random).encode(reader.encoding)
        return mutate_bytes(random, data) if random.random() < 0.2 else data
    texts = seed_texts(reader)
    text = random.choice(texts)
    if random.random() < 0.5:
        return reader.mutate(random, text, texts).encode(reader.encoding, "replace")
    data = text.encode(reader.encoding)
    if random.random() < 0.03:
        return amplify(random, data)
    return mutate_bytes(random, data)


def seed_texts(reader: Reader) -> list[str]:
    """Return the reader's real files."""
    files = (ROOT / name for name in reader.seeds)
    return [shortened(file.read_bytes().decode(reader.encoding)) for file in files]


def try_input(reader: Reader, data: bytes, folder: Path) -> str | None:
    """Read ``data`` from a file; what was wrong with that, None: nothing."""
    path = folder / reader.file
    path.write_bytes(data)
    begin_s = time.process_time()
    try:
        text = reader.finding(path)
    except BaseException:  # noqa: BLE001 - whatever it is, it is what was looked for
        text = traceback.format_exc()
    used_s = time.process_time() - begin_s
    return f"{used_s:.1f} s of the processor" if text is None and used_s > CPU_S else text


def run(seed: int, seconds: float, names: list[str]) -> Iterator[FuzzFailure | dict[str, int]]:
    """Findings as they come, and now and then how many inputs each reader had."""
    first, end_s = 0, time.monotonic() + seconds
    counts = dict.fromkeys(names, 0)
    while time.monotonic() < end_s:
        ours, theirs = multiprocessing.Pipe()
        process = multiprocessing.get_context("fork").Process(
            target=_worker, args=(theirs, seed, first, names), daemon=True
        )
        process.start()
        theirs.close()
        name = ""  # of the reader that reads now; empty before the first input
        try:
            while time.monotonic() < end_s:
                message = _receive(ours)
                if isinstance(message, FuzzFailure):
                    yield message
                    continue
                name, first = message
                counts[name] += 1
                if first % 1000 == 0:
                    yield dict(counts)
        except EOFError as error:
            text = str(error) or f"the process died: {process.exitcode}"
            if not name:
                raise RuntimeError(f"no reader of {names} got an input: {text}") from error
            reader = next(reader for reader in READERS if reader.name == name)
            yield FuzzFailure(name, first, text, make_input(reader, seed, first))
            first += 1
        finally:
            process.kill()
            process.join()
    yield counts


def _receive(connection: Connection) -> FuzzFailure | tuple[str, int]:
    """The next message of a worker. Raises EOFError: it hangs, or is dead."""
    if not connection.poll(HANG_S):
        raise EOFError("hangs")
    message: FuzzFailure | tuple[str, int] = connection.recv()
    return message


def _worker(connection: Connection, seed: int, first: int, names: list[str]) -> None:
    """Announces each input, so that it is known which one was fatal."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    limit = pages * resource.getpagesize() + MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    logging.disable()  # what a library says of a bad file
    readers = [reader for reader in READERS if reader.name in names]
    with TemporaryDirectory(prefix="robotd-fuzz-") as folder:
        index = first
        while True:
            for reader in readers:
                connection.send((reader.name, index))
                data = make_input(reader, seed, index)
                if text := try_input(reader, data, Path(folder)):
                    connection.send(FuzzFailure(reader.name, index, text, data))
            index += 1


def shortened(text: str) -> str:
    """Without its middle where it is long: 128 axes are read no other way than two."""
    if len(text) <= LONGEST:
        return text
    begin, end = text.find("<AxisParameters"), text.find('<AxisParameters Axis="2"')
    return text[:end] + "</Parameters>\n" if 0 < begin < end else text
