"""The same inputs, guided by the lines that they reach: ``python -m tools.fuzz.guided robot``.

Needs ``pip install atheris``, which is not a dependency. Options of libFuzzer follow the reader's
name, for instance ``-max_total_time=300``. The first finding ends it, and is kept as a file.
"""

from __future__ import annotations

import logging
import sys
import tempfile
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["robotd", "robotd_canopen", "robotd_ethercat"]):
    from tools.fuzz.campaign import seed_texts, try_input
    from tools.fuzz.mutations import mutate_bytes
    from tools.fuzz.readers import READERS

STRUCTURED = 0.5  # share of the changes that know the structure


def main(name: str, options: list[str]) -> None:
    reader = next(reader for reader in READERS if reader.name == name)
    texts = seed_texts(reader)
    logging.disable()

    def change(data: bytes, max_size: int, seed: int) -> bytes:
        random = Random(seed)
        if random.random() < STRUCTURED:
            try:
                return reader.mutate(random, data.decode(reader.encoding), texts).encode(
                    reader.encoding
                )[:max_size]
            except Exception:  # noqa: BLE001 - it is no such text any more
                return mutate_bytes(random, data)[:max_size]
        changed: bytes = atheris.Mutate(data, max_size)
        return changed

    with tempfile.TemporaryDirectory(prefix="robotd-fuzz-") as folder:
        corpus = Path(folder) / "corpus"
        corpus.mkdir()
        for number, text in enumerate(texts):
            (corpus / str(number)).write_bytes(text.encode(reader.encoding))

        def read(data: bytes) -> None:
            if text := try_input(reader, data, Path(folder)):
                raise AssertionError(text)

        arguments = [sys.argv[0], "-max_len=50000", "-timeout=30", *options, str(corpus)]
        atheris.Setup(arguments, read, custom_mutator=change)
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
