"""MCAP files of any program: opened, with damage as an error that names its remedy."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from robotd.api import RecordingError

MAGIC = b"\x89MCAP0\r\n"


@contextmanager
def open_mcap(path: Path, kind: str) -> Iterator[IO[bytes]]:
    """Open an MCAP file for ``read_records`` in the block.

    ``kind``: what a file is not whose content the block rejects by ValueError, KeyError, TypeError.

    Raises RecordingError: no such file, another file, one that exceeds a limit, or one that is
    damaged or was not closed: then the text names the command that repairs it.
    """
    from mcap.exceptions import McapError
    from mcap.stream_reader import CRCValidationError
    from zstandard import ZstdError

    try:
        with path.open("rb") as stream:
            if stream.read(len(MAGIC)) != MAGIC:  # neither one that was not closed
                raise RecordingError(f"{path}: not a recording: it does not begin as an MCAP file")
            stream.seek(0)
            yield stream
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from error
    except (McapError, CRCValidationError, ZstdError, RuntimeError, struct.error) as error:
        text = f"{path}: not a complete MCAP file ({str(error) or type(error).__name__})"
        raise RecordingError(f"{text}; try: robotd record --recover {path}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path}: not {kind}: {error}") from error
