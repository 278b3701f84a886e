"""Every reader of text that comes from outside, with real files to begin from."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import click
from pydantic import TypeAdapter, ValidationError
from tools.fuzz import grammars
from tools.fuzz.mutations import Mutator, mutate_lines, mutate_xml, mutate_yaml

from robotd.cli.urdf_check import check_urdf
from robotd.descriptor import RobotDescriptor, load_robot_descriptor
from robotd.errors import DescriptorError, RobotdError
from robotd.plugin.manager import load_backend
from robotd_canopen.eds_report import eds_report
from robotd_canopen.object_dictionary import read_eds
from robotd_ethercat.esi_reader import read_esi
from robotd_ethercat.esi_report import detail_lines, esi_sections
from robotd_page.control_panel import requests_of
from robotd_recording.recording_reader import read_recording
from robotd_recording.recording_repair import recover
from robotd_scenario import load_scenario, requested_fault
from robotd_scenario.sim_command import _value
from robotd_teach.page_panel import TeachPanel
from robotd_wmx_parameters import read_wmx_parameters

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Reader:
    """One kind of text.

    Attributes:
        file: name of the file that is read; some readers go by its ending.
        seeds: real files, relative to the repository.
        read: reads it; anything but its rejections is a finding.
        mutate: changes its structure.
        generate: a text from nothing, of words that mean something there.
        in_file: whether a rejection has to name the file.
        encoding: of the file as text; latin-1 for one that is not text, byte by byte.
    """

    name: str
    file: str
    seeds: tuple[str, ...]
    read: Callable[[Path], object]
    mutate: Mutator
    generate: Callable[[Random], str]
    in_file: bool = True
    encoding: str = "utf-8"

    def finding(self, path: Path) -> str | None:
        """Return the problem of reading ``path``; None: it is read, or rejected properly."""
        try:
            self.read(path)
        except DescriptorError as error:
            if self.in_file and error.path is None:
                return f"a rejection without a file: {str(error)[:200]}"
            if len(str(error)) > MAX_TEXT:
                return f"a rejection of {len(str(error))} characters: {str(error)[:200]}"
        except (RobotdError, click.BadParameter) as error:
            if self.in_file:
                return f"{type(error).__name__} instead of DescriptorError: {str(error)[:200]}"
        return None


MAX_TEXT = 100_000
"""Characters of the longest rejection that a person, or a service's response, has to take."""


def _robot(path: Path) -> object:
    descriptor = load_robot_descriptor(path)
    return load_backend("canopen" if "canopen" in descriptor.backends else "sim").context(
        descriptor
    )


def _eds(path: Path) -> object:
    """Read an EDS or DCF and what robotd does with it; the reader keeps what it has read."""
    read_eds.cache_clear()
    return list(eds_report(path, 5))


def _esi(path: Path) -> object:
    devices = read_esi(path)
    return [*(list(detail_lines(device)) for device in devices), esi_sections(devices)]


def _urdf(path: Path) -> None:
    check_urdf(path, _cr3a())


def _words(path: Path) -> object:
    """Parse words as ``robotd sim inject`` does."""
    kind, *lines = path.read_bytes().decode(errors="surrogateescape").split("\n")
    return requested_fault(kind, dict(_value(line) for line in lines))


def _recording(path: Path) -> object:
    """Read a recording, and mend it as one that was cut off."""
    path.with_name(f"{path.name}.damaged").unlink(missing_ok=True)
    with suppress(RobotdError):
        read_recording(path)
    return recover(path)


def _page_messages(path: Path) -> None:
    """Take each line as a message of a page with control."""
    for line in path.read_bytes().decode(errors="replace").split("\n"):
        with suppress(ValidationError):
            requests().validate_json(line)


@cache
def requests() -> TypeAdapter[Any]:
    return requests_of((*TeachPanel.commands, *TeachPanel.holds))


@cache
def _cr3a() -> RobotDescriptor:
    return load_robot_descriptor("cr3a")


READERS = (
    Reader(
        "parameters",
        "parameters.xml",
        ("robots/cr3a/wmx_parameters.xml",),
        read_wmx_parameters,
        mutate_xml,
        grammars.parameters,
    ),
    Reader(
        "robot",
        "robot.yaml",
        ("robots/cr3a/robot.yaml", "robots/baymax/robot.yaml", "robots/standalone/robot.yaml"),
        _robot,
        mutate_yaml,
        grammars.robot,
    ),
    Reader(
        "scenario",
        "scenario.yaml",
        ("examples/scenarios/alarm.yaml", "examples/scenarios/pick_and_place.yaml"),
        load_scenario,
        mutate_yaml,
        grammars.scenario,
    ),
    Reader(
        "eds",
        "drive.eds",
        (
            "plugins/canopen/robotd_canopen/eds/generic_401.eds",
            "plugins/canopen/robotd_canopen/eds/generic_402.eds",
            "tests/plugins/canopen/eds/small.dcf",
        ),
        _eds,
        mutate_lines,
        grammars.eds,
    ),
    Reader(
        "esi",
        "device.xml",
        ("tests/plugins/ethercat/esi/drive.xml", "tests/plugins/ethercat/esi/modular.xml"),
        _esi,
        mutate_xml,
        grammars.esi,
    ),
    Reader(
        "urdf",
        "robot.urdf",
        ("robots/cr3a/cr3a.urdf", "robots/baymax/baymax.urdf"),
        _urdf,
        mutate_xml,
        grammars.urdf,
    ),
    Reader(
        "words",
        "words.txt",
        ("tools/fuzz/words.txt",),
        _words,
        mutate_lines,
        grammars.words,
        in_file=False,
    ),
    Reader(
        "recording",
        "recording.mcap",
        ("tools/fuzz/recording.mcap",),
        _recording,
        mutate_lines,
        lambda random: "\x89MCAP0\r\n" + random.randbytes(random.randrange(4000)).decode("latin-1"),
        in_file=False,
        encoding="latin-1",
    ),
    Reader(
        "page",
        "page_messages.txt",
        ("tools/fuzz/page_messages.txt",),
        _page_messages,
        mutate_lines,
        grammars.words,
        in_file=False,
    ),
)
