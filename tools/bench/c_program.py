"""Compiles baseline.c against the ROS of this environment, wheels or installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).with_name("baseline.c")
LIBRARIES = (
    "rcl",
    "rcutils",
    "rmw",
    "rosidl_runtime_c",
    *(
        f"{package}__rosidl_{part}"
        for package in ("sensor_msgs", "std_msgs", "std_srvs", "wmx_ros2_message")
        for part in ("typesupport_c", "generator_c")
    ),
)


class CannotBuildError(Exception):
    """No C baseline here; the text says why."""


class CProgram:
    """``command`` and ``environment`` of the compiled program.

    Args:
        folder: where it is built; must exist as long as it is used.

    Raises:
        CannotBuildError: no compiler, no headers of ROS, or the compiler refuses.
    """

    def __init__(self, folder: Path) -> None:
        compiler = shutil.which("gcc") or shutil.which("cc")
        prefixes = _prefixes()
        if compiler is None:
            raise CannotBuildError("no C compiler")
        if not prefixes:
            raise CannotBuildError("no headers of rcl in this environment")
        self.command = [str(folder / "baseline")]
        libraries = [str(prefix / "lib") for prefix in prefixes]
        call = [
            *(compiler, "-std=gnu11", "-O2", str(SOURCE), "-o", self.command[0], "-pthread"),
            *(f"-I{path}" for prefix in prefixes for path in (prefix / "include").iterdir()),
            *(f"-L{path}" for path in libraries),
            # Libraries of wheels name others by paths of the machine that they were made on.
            "-Wl,--unresolved-symbols=ignore-in-shared-libs,--as-needed",
            *(f"-l{library}" for library in LIBRARIES),
        ]
        _run(call)
        stubs = _python_stubs(compiler, folder / "stubs", prefixes)
        own = os.environ.get("LD_LIBRARY_PATH", "").split(":")
        self.environment = {"LD_LIBRARY_PATH": ":".join([str(stubs), *libraries, *own])}
        # In the wheels' environment nothing sets it; rmw looks for its typesupports there.
        self.environment["AMENT_PREFIX_PATH"] = ":".join(map(str, prefixes))


def _prefixes() -> list[Path]:
    """Prefix of ROS: the environment of the wheels, or the sourced one."""
    sourced = os.environ.get("AMENT_PREFIX_PATH", "").split(":")
    found = [Path(path) for path in (sys.prefix, *sourced) if path]
    with_headers = [path for path in dict.fromkeys(found) if (path / "include").is_dir()]
    return with_headers if any((path / "include/rcl").exists() for path in found) else []


def _python_stubs(compiler: str, folder: Path, prefixes: list[Path]) -> Path:
    """Empty stand-ins of the Python typesupports, which rcl's wheel links and never calls.

    The real ones need libpython, which a C program does not have.
    """
    folder.mkdir()
    stub = folder / "stub.so"
    _run([compiler, "-shared", "-o", str(stub), "-x", "c", "/dev/null"])
    for prefix in prefixes:
        for library in (prefix / "lib").glob("lib*__rosidl_generator_py.so"):
            (folder / library.name).symlink_to(stub)
    return folder


def _run(command: list[str]) -> None:
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        raise CannotBuildError(result.stderr.strip().splitlines()[0])
