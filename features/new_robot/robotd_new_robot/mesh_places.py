"""Copy the meshes of a URDF into the folder of a new robot, and rename them in its text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robotd.api.models import mesh_files
from robotd_shared.mesh_files import gltf_parts, moved_mesh_names, with_mesh_names

FOLDER = "meshes"  # of a robot


@dataclass(frozen=True)
class PlacedMeshes:
    """A URDF whose meshes are found from where it is written.

    Attributes:
        text: of the URDF.
        files: to copy, by their paths in the folder of the URDF.
        summary: one line for the user; "" for a URDF without meshes.
    """

    text: str
    files: Mapping[str, Path]
    summary: str


def place_meshes(
    text: str, path: Path, written: Path, folders: Sequence[Path], *, copy: bool
) -> PlacedMeshes:
    """Find the meshes of a URDF, and name them for another folder.

    Args:
        path: of the URDF that is read.
        written: path that it gets.
        folders: searched in addition, see ``find_mesh``.
        copy: copy the meshes into the folder of ``written``.
    """
    found = mesh_files(text, path, folders)
    files: dict[str, Path] = {}
    if copy:
        renamed = {name: _copied(file, files) for name, file in found.items() if file}
    else:
        renamed = moved_mesh_names(found, written)
    return PlacedMeshes(
        with_mesh_names(text, renamed), files, _summary([*found.values()], copy=copy)
    )


def _copied(file: Path, files: dict[str, Path]) -> str:
    """Add a mesh and its parts to ``files``; return its name there."""
    for known, source in files.items():
        if source == file:
            return known
    taken = {Path(known).parts[1] for known in files}
    parts = gltf_parts(file) if file.suffix.lower() == ".gltf" else []
    name, number = (file.stem if parts else file.name), 2
    while name in taken:
        name, number = f"{number}_{file.stem if parts else file.name}", number + 1
    place = f"{FOLDER}/{name}/{file.name}" if parts else f"{FOLDER}/{name}"
    files[place] = file
    files |= {f"{FOLDER}/{name}/{part}": file.parent / part for part in parts}
    return place


def _summary(meshes: Sequence[Path | None], *, copy: bool) -> str:
    """Return what became of the meshes; None among them is one that was not found."""
    if not meshes:
        return ""
    found = [file for file in meshes if file is not None]
    size = sum(file.stat().st_size for file in {*found})
    mebibytes = f"{size / 2**20:.1f} MiB"
    if copy:
        text = f"{_count(len(found))} copied, {mebibytes}"
    else:
        text = f"{_count(len(found))} left in place, {mebibytes}; --copy-meshes copies them"
    missing = len(meshes) - len(found)
    return f"{text}; {_count(missing)} not found: --meshes FOLDER" if missing else text


def _count(meshes: int) -> str:
    return f"{meshes} mesh{'' if meshes == 1 else 'es'}"
