"""Run a generator of rosidl: run_generator.py GENERATOR ARGUMENTS.

Five generators read the same .idl files, and each takes longer to parse them than to fill in its
templates. The first one saves what it parsed beside the file, in the build folder.
"""

import gc
import os
import pickle
import runpy
import sys
from pathlib import Path

from rosidl_parser import parser
from rosidl_parser.definition import IdlFile, IdlLocator

parse_idl_file = parser.parse_idl_file


def parse_once(locator: IdlLocator, png_file: str | None = None) -> IdlFile:
    """Return the content of an .idl file; parse it if no generator did before."""
    path: Path = locator.get_absolute_path()
    saved = path.with_suffix(".parsed")
    if saved.exists() and saved.stat().st_mtime_ns > path.stat().st_mtime_ns:
        return pickle.loads(saved.read_bytes())  # noqa: S301 - of this build
    idl_file = parse_idl_file(locator, png_file)
    partial = saved.with_suffix(f".{os.getpid()}")  # generators run at the same time
    partial.write_bytes(pickle.dumps(idl_file))
    partial.replace(saved)
    return idl_file


gc.disable()  # the process ends soon and has memory enough
parser.parse_idl_file = parse_once
del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
