"""The binding's sources compile against every edition of the headers that is known of.

Editions differ in whether SetServoOn takes a time-out, CloseDevice a flag, in status members,
statistics, the size of a spline, the numbers of EtherCAT states and the type of a result. Only
the syntax is checked: the libraries of one edition are enough for the other tests.
"""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import nanobind
import pytest

from standin_build import BUILD, PLUGIN, run

NEWER = {
    "servo_on": 1,
    "close_device_flag": 1,
    "newer_status": 1,
    "statistics_counts": 1,
    "ec_states_by_bit": 1,
    "spline_dimensions": 8,
    "result": "long",
}
OLDER = {
    "servo_on": 0,
    "close_device_flag": 0,
    "newer_status": 0,
    "statistics_counts": 0,
    "ec_states_by_bit": 0,
    "spline_dimensions": 6,
    "result": "int",
}
EDITIONS = {
    "newer": NEWER,
    "older": OLDER,
    "servo time-out as an overload": NEWER | {"servo_on": 2},
    "servo time-out without a default": OLDER | {"servo_on": 3},
}


def configure(name: str, edition: dict[str, object]) -> Path:
    """The headers of an edition; returns the folder to include from."""
    where = BUILD / "editions" / name.replace(" ", "-")
    options = [f"-DSTANDIN_{key.upper()}={value}" for key, value in edition.items()]
    run("cmake", "-S", PLUGIN / "tests" / "standin", "-B", where, "-G", "Ninja", *options)
    return where / "sdk" / "include"


def compile_sources(include: Path, source: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [
            "g++", "-std=c++17", "-fsyntax-only", "-fsigned-char", "-Wall", "-Wextra", "-Werror",
            "-isystem", str(include), *options, str(source),
        ],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("name", EDITIONS)
def test_the_binding_compiles(name: str, tmp_path: Path) -> None:
    include = configure(name, EDITIONS[name])
    unity = tmp_path / "unity.cpp"
    sources = sorted((PLUGIN / "src").glob("*.cpp"))
    unity.write_text("".join(f'#include "{source}"\n' for source in sources), "utf-8")
    packages = Path(nanobind.include_dir())
    done = compile_sources(
        include, unity, "-I", str(PLUGIN / "src"), "-isystem", str(packages),
        "-isystem", str(packages.parent / "ext" / "robin_map" / "include"),
        "-isystem", sysconfig.get_path("include"), '-DWMX3_SDK_ROOT="/opt/wmx3/"',
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.parametrize("name", ["newer", "older"])
def test_a_customers_program_compiles_unchanged(name: str) -> None:
    include = configure(name, EDITIONS[name])
    done = compile_sources(include, PLUGIN / "tests" / "programs" / "mover.cpp")
    assert done.returncode == 0, done.stderr[:4000]


def test_a_mistake_would_be_found(tmp_path: Path) -> None:
    include = configure("older", OLDER)
    source = tmp_path / "mistake.cpp"
    source.write_text(
        "#include <CoreMotionApi.h>\n"
        "int f(wmx3Api::AxisControl &a) { return static_cast<int>(a.SetServoOn(0, 1, 1000)); }\n",
        "utf-8",
    )
    assert "no matching function" in compile_sources(include, source).stderr


def test_without_an_sdk_the_build_stops_with_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="robotd-wmx is built where the WMX3 SDK is"):
        run("cmake", "-S", PLUGIN, "-B", tmp_path, "-G", "Ninja", WMX3_SDK_PATH="/nowhere")
