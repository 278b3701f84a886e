"""Builds the stand-in for the SDK and, against it, the plugin as pip would install it.

Everything goes into ``build/`` beside the sources and is built again only where sources changed.
Test runs may share it: one builds, the others wait.
"""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PLUGIN = Path(__file__).resolve().parent.parent
BUILD = PLUGIN / "build"
SDK = BUILD / "standin" / "sdk"
SITE = BUILD / "site"
SOURCES = (
    "CMakeLists.txt",
    "README.md",
    "cmake",
    "pyproject.toml",
    "robotd_wmx",
    "src",
    "tests/standin",
)
# Tools of the environment that runs the tests come before the system's.
ENVIRONMENT = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}


def run(*command: str | Path, **variables: str) -> str:
    """Standard output of a command; its whole output is in the error when it fails."""
    result = subprocess.run(
        [str(word) for word in command],
        env=ENVIRONMENT | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    if result.returncode:
        raise RuntimeError(f"{command[0]} failed\n{result.stdout}\n{result.stderr}")
    return result.stdout


def build_standin(
    where: Path = BUILD / "standin", kind: str = "Release", **variant: object
) -> Path:
    """Configure and build an edition of the SDK; returns its root."""
    options = [f"-DSTANDIN_{name.upper()}={value}" for name, value in variant.items()]
    options.append(f"-DCMAKE_BUILD_TYPE={kind}")
    run("cmake", "-S", PLUGIN / "tests" / "standin", "-B", where, "-G", "Ninja", *options)
    run("cmake", "--build", where, "--parallel", "2")
    return where / "sdk"


def build_plugin() -> Path:
    """Install the plugin into a folder of its own; returns it."""
    run(
        sys.executable, "-m", "pip", "install", "--quiet", "--no-build-isolation", "--no-deps",
        "--upgrade", "--target", SITE, "-C", f"build-dir={BUILD / 'native'}", PLUGIN,
        WMX3_SDK_PATH=str(SDK), CMAKE_BUILD_PARALLEL_LEVEL="2",
    )  # fmt: skip
    return SITE


def build_all() -> Path:
    """Build stand-in and plugin unless they are newer than their sources; return the plugin."""
    built = BUILD / "built"
    with _alone():
        if not built.exists() or built.stat().st_mtime < _newest_source_s():
            build_standin()
            build_plugin()
            built.touch()
    return SITE


def _newest_source_s() -> float:
    roots = [PLUGIN / name for name in SOURCES]
    files = [path for root in roots for path in (root, *root.rglob("*"))]
    return max(path.stat().st_mtime for path in files if "__pycache__" not in path.parts)


@contextmanager
def _alone() -> Iterator[None]:
    BUILD.mkdir(exist_ok=True)
    with (BUILD / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def build_program(source: Path, sdk: Path = SDK) -> Path:
    """Compile a C++ program as a customer of the SDK would; returns it."""
    program = sdk.parent / "programs" / source.stem
    program.parent.mkdir(parents=True, exist_ok=True)
    run(
        "g++", "-std=c++17", "-fsigned-char", "-I", sdk / "include", source, "-o", program,
        "-L", sdk / "lib", f"-Wl,-rpath,{sdk / 'lib'}",
        "-lcoremotionapi", "-ladvancedmotionapi", "-lioapi", "-lecapi", "-lwmx3api", "-limdll",
    )  # fmt: skip
    return program


if __name__ == "__main__":
    print(build_all())
