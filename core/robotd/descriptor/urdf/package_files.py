"""Files of ``package://`` and other URLs in a URDF or xacro file: meshes and packages."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

from robotd.descriptor.files import is_file
from robotd.descriptor.urdf.urdf_text import xml_root


def mesh_names(root: Any, kinds: Sequence[str] = ("visual", "collision")) -> list[str]:
    """Return the names of the meshes below the root element of a URDF, each once."""
    found = [mesh for kind in kinds for mesh in root.iterfind(f".//{kind}/geometry/mesh")]
    return list(dict.fromkeys(mesh.get("filename", "") for mesh in found))


def mesh_files(text: str, path: Path, folders: Sequence[Path] = ()) -> dict[str, Path | None]:
    """Return the file of each mesh of a URDF by name; None if missing.

    Args:
        text: of the URDF.
        path: of the URDF.
        folders: see ``find_mesh``.
    """
    return {name: find_mesh(name, path, folders) for name in mesh_names(xml_root(text, path))}


def find_mesh(name: str, path: Path | None, folders: Sequence[Path] = ()) -> Path | None:
    """Return the file of a mesh; None where there is none.

    Args:
        name: in the URDF: a path, or a URL of the scheme ``file`` or ``package``.
        path: of the URDF, which relative names start from.
        folders: searched in addition, first for the whole name, then for its end.
    """
    url = urlparse(name)
    location = unquote(url.path)
    places = [*_places(url.scheme, url.netloc, location, path)]
    inside = Path(location.lstrip("/"))
    for folder in folders:
        places += [folder / url.netloc / inside, folder / inside, folder / inside.name]
    return next(filter(is_file, places), None)


def package_folders(package: str, path: Path | None) -> Iterator[Path]:
    """Yield the folders that a package may have, the most likely first."""
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(prefix, "share", package)
    for folder in path.absolute().parents if path else ():
        if folder.name == package:
            yield folder
        yield folder / package


def _places(scheme: str, package: str, location: str, path: Path | None) -> Iterator[Path]:
    if scheme == "package":
        for folder in package_folders(package, path):
            yield folder / location.lstrip("/")
    elif scheme in ("", "file") and path:
        yield path.absolute().parent / location
