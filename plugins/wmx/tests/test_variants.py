"""The binding builds, links and works against every edition of the SDK that is known of.

Editions differ in whether SetServoOn takes a time-out, CloseDevice a flag, in status members,
statistics, the size of a spline, the numbers of EtherCAT states and the type of a result.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from standin_build import BUILD, PLUGIN, build_program, build_standin, run

PROGRAMS = PLUGIN / "tests" / "programs"
NEWER = {
    "servo_on": 1,
    "close_device_flag": 1,
    "newer_status": 1,
    "statistics_counts": 1,
    "ec_states_by_bit": 1,
    "spline_dimensions": 8,
    "result": "long",
    "cyclic_buffer": 1,
}
OLDER = {
    "servo_on": 0,
    "close_device_flag": 0,
    "newer_status": 0,
    "statistics_counts": 0,
    "ec_states_by_bit": 0,
    "spline_dimensions": 6,
    "result": "int",
    "cyclic_buffer": 0,
}
EDITIONS = {
    "newer": NEWER,
    "older": OLDER,
    "servo time-out as an overload": NEWER | {"servo_on": 2},
    "older cyclic buffer": OLDER | {"cyclic_buffer": 2},
}


@pytest.fixture
def edition(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An edition of the SDK by its name, built, with an engine of its own."""
    name: str = request.param
    memory = f"wmx-edition-{os.getpid()}-{folder(name).name}"
    monkeypatch.setenv("WMX_STANDIN_SHM", memory)  # its layout is the edition's
    build_standin(folder(name), "Debug", **EDITIONS[name])
    yield name
    Path("/dev/shm", memory).unlink(missing_ok=True)


def folder(name: str) -> Path:
    return BUILD / "editions" / name.replace(" ", "-")


def build_binding(name: str) -> Path:
    """The folder with the binding against an edition; every warning is an error."""
    where = folder(name) / "native"
    options = ("CMAKE_BUILD_TYPE=Debug", "CMAKE_UNITY_BUILD=ON", "CMAKE_CXX_FLAGS=-Werror")
    run(
        "cmake", "-S", PLUGIN, "-B", where, "-G", "Ninja", f"-DPython_EXECUTABLE={sys.executable}",
        *(f"-D{option}" for option in options), WMX3_SDK_PATH=str(folder(name) / "sdk"),
    )  # fmt: skip
    run("cmake", "--build", where, "--parallel", "2")
    return where


@pytest.mark.parametrize("edition", EDITIONS, indirect=True)
def test_the_binding_works(edition: str) -> None:
    told = run(sys.executable, PROGRAMS / "smoke.py", build_binding(edition))
    flag, dimensions = (
        EDITIONS[edition][key] for key in ("close_device_flag", "spline_dimensions")
    )
    cyclic = int(bool(EDITIONS[edition]["cyclic_buffer"]))
    assert told.split() == [f"kept={flag}", f"spline={dimensions}", f"cyclic={cyclic}"]


@pytest.mark.parametrize("edition", ["newer", "older"], indirect=True)
def test_a_customers_program_works_unchanged(edition: str, tmp_path: Path) -> None:
    sdk = folder(edition) / "sdk"
    program = build_program(PROGRAMS / "every_call.cpp", sdk)
    assert run(program, f"{sdk}/", tmp_path / "parameters.xml") == "all calls are there\n"


def test_a_mistake_would_be_found(tmp_path: Path) -> None:
    build_standin(folder("older"), "Debug", **OLDER)
    source = tmp_path / "mistake.cpp"
    source.write_text(
        "#include <CoreMotionApi.h>\n"
        "int main() { return sizeof(wmx3Api::CoreMotion().axisControl->SetServoOn(0, 1, 9)); }\n",
        "utf-8",
    )
    with pytest.raises(RuntimeError, match="no matching function"):
        build_program(source, folder("older") / "sdk")


def test_without_an_sdk_the_build_stops_with_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="robotd-wmx is built where the WMX3 SDK is"):
        run("cmake", "-S", PLUGIN, "-B", tmp_path, "-G", "Ninja", WMX3_SDK_PATH="/nowhere")
