"""Panel ``Teach`` of the page: what it offers, and its state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from robotd.api import Capability, NotReady, RobotdError
from robotd.api.robots import Robot
from robotd_page.control_commands import Command
from robotd_page.held_motion import Heartbeat, HeldMotion
from robotd_teach.page_commands import COMMANDS
from robotd_teach.page_guiding import Guide, HeldGuiding
from robotd_teach.page_preview import HeldPreview, PlayPreview, Preview
from robotd_teach.path_file import paths_in
from robotd_teach.paths import Paths
from robotd_teach.poses import Poses
from robotd_teach.program_folder import ProgramFolder, version_of
from robotd_teach.programs import Programs

DECIMALS = 4


class TeachPanel:
    """Panel for ``robotd_page.control_panel.ControlPanel``."""

    commands: Sequence[type[Command]] = (*COMMANDS, Preview)
    holds: Mapping[type[Heartbeat], Callable[..., HeldMotion[Any]]] = {
        Guide: HeldGuiding,
        PlayPreview: HeldPreview,
    }

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._poses, self._paths = robot.feature(Poses), robot.feature(Paths)
        self._programs, self._folder = robot.feature(Programs), robot.feature(ProgramFolder)
        self._read: dict[str, tuple[Any, Any]] = {}  # version and content of files, by part

    def describe(self) -> dict[str, Any]:
        """Return joint groups, folder of programs, and whether and how joints can be guided."""
        capabilities = self._robot.capabilities
        return {
            "groups": [name for name, group in self._robot.groups.items() if group.joint_names],
            "folder": str(self._folder.path),
            "guides": Capability.HAND_GUIDING in capabilities,
            "falls": Capability.FALLS_WHEN_GUIDED in capabilities,
        }

    def state(self) -> dict[str, Any]:
        """Return poses, paths, programs, and what is recorded and run. Worker.

        A file is read where it differs from the last time.
        """
        poses, paths = self._poses.path, paths_in(self._paths.folder)
        programs = self._folder.all()
        state = self._programs.state._asdict()
        return {
            "poses": self._newest("poses", [poses], self._read_poses),
            "paths": self._newest("paths", paths.values(), self._read_paths),
            "programs": programs,
            "recording": self._recording(),
            "run": {**state, "name": self._name(state["file"])},
        }

    def _newest(self, part: str, files: Any, read: Callable[[], Any]) -> Any:
        version = [(str(file), version_of(file)) for file in files]
        if self._read.get(part, (None,))[0] != version:
            self._read[part] = version, read()
        return self._read[part][1]

    def _read_poses(self) -> dict[str, Any]:
        try:
            found, problems = self._poses.all(), self._poses.problems()
        except RobotdError as error:
            return {"error": str(error), "poses": {}}
        poses = {
            name: {
                "joints": {joint: round(position, DECIMALS) for joint, position in joints.items()},
                "problem": problems.get(name, ""),
            }
            for name, joints in found.items()
        }
        return {"error": "", "poses": poses}

    def _read_paths(self) -> dict[str, Any]:
        return {name: state._asdict() for name, state in self._paths.all().items()}

    def _recording(self) -> dict[str, Any] | None:
        try:
            state = self._paths.recording_state()
        except NotReady:
            return None
        return {
            "name": state.name,
            "duration_s": round(state.duration_s, 1),
            "reason": state.reason,
        }

    def _name(self, file: str) -> str:
        """Return the name of a program in the folder; "": it comes from elsewhere."""
        path = Path(file)
        return path.stem if file and path.parent == self._folder.path else ""
