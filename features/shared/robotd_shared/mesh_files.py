"""Files of the meshes in a URDF by URL, and their new names in a copy of its text."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from robotd.api import DescriptorError, get_logger
from robotd.api.models import find_mesh, is_file, mesh_names, xml_root

log = get_logger("page")

SUFFIXES = (".stl", ".dae", ".glb", ".gltf")
PART_SUFFIXES = (".bin", ".png", ".jpg", ".jpeg", ".webp")  # of a glTF in several files
MAX_MESH_BYTES = 64 * 2**20
FOLDER = "/mesh/"  # of the server
_FILENAME = re.compile(r"""(<mesh\b[^>]*?\bfilename\s*=\s*)(["'])(.*?)\2""")


class MeshFiles:
    """Files that the server may read, by their URL. One thread adds, any thread reads.

    Args:
        folder: first part of the URLs.
    """

    def __init__(self, folder: str = FOLDER) -> None:
        self._folder = folder
        self._files: dict[str, Path] = {}
        self._count = 0

    def add(self, urdf: str, path: Path | None) -> dict[str, str]:
        """Return the URL of each mesh of a URDF, by its name there.

        Args:
            urdf: text of the URDF; "" for none.
            path: file of the URDF, which relative names start from.
        """
        urls = {}
        for name, file in drawable_meshes(urdf, path).items():
            folder = f"{self._folder}{self._count}/"
            self._count += 1
            self._files[folder + file.name] = file
            urls[name] = quote(folder + file.name)
            if file.suffix.lower() == ".gltf":
                self._files |= {folder + part: file.parent / part for part in gltf_parts(file)}
        return urls

    def file(self, url: str) -> Path | None:
        """Return the file of a decoded URL; None where there is none."""
        return self._files.get(url)


def drawable_meshes(urdf: str, path: Path | None) -> dict[str, Path]:
    """Return the file of each visual mesh, by its name in the URDF.

    A mesh that is not found or has another format is logged and left out.

    Args:
        urdf: text of the URDF; "" for none.
        path: file of the URDF, which relative names start from.
    """
    found: dict[str, Path] = {}
    for name in _names(urdf):
        file = find_mesh(name, path)
        if file is None:
            log.warning("mesh not found: the link is not drawn", mesh=name)
        elif file.suffix.lower() not in SUFFIXES or file.stat().st_size > MAX_MESH_BYTES:
            log.warning("mesh not drawn: STL, DAE and glTF up to 64 MiB are", mesh=name)
        else:
            found[name] = file
    return found


def gltf_parts(file: Path) -> list[str]:
    """Return the buffers and images of a glTF, beside it or below.

    Other ones are logged and left out.
    """
    try:
        content = json.loads(file.read_bytes())
        parts = [unquote(part) for part in _part_names(content)]
    except (OSError, ValueError, AttributeError, TypeError) as error:
        log.warning("mesh not drawn: no glTF", mesh=str(file), reason=str(error))
        return []
    found = []
    for part in parts:
        inside = (file.parent / part).resolve().is_relative_to(file.parent.resolve())
        if inside and Path(part).suffix.lower() in PART_SUFFIXES and is_file(file.parent / part):
            found.append(part)
        else:
            log.warning("part of a glTF is not served", mesh=str(file), part=part)
    return found


def _part_names(content: Any) -> Iterator[str]:
    for resource in (*content.get("buffers", ()), *content.get("images", ())):
        name = resource.get("uri", "")
        if name and not name.startswith("data:"):
            yield name


def _names(urdf: str) -> list[str]:
    try:
        return mesh_names(xml_root(urdf, Path()), ("visual",)) if urdf else []
    except DescriptorError:
        return []


def moved_mesh_names(files: Mapping[str, Path | None], place: Path | None) -> dict[str, str]:
    """Return ``file`` URLs for the meshes that would be lost in another place.

    Args:
        files: see ``mesh_files``.
        place: new path of the URDF; None: it has none, as for MoveIt, which gets the text.
    """
    return {
        name: file.absolute().as_uri()
        for name, file in files.items()
        if file is not None and find_mesh(name, place) != file
    }


def with_mesh_names(text: str, renamed: Mapping[str, str]) -> str:
    """Return the text of a URDF with other names of meshes."""

    def attribute(match: re.Match[str]) -> str:
        head, quote, written = match.groups()
        name = renamed.get(html.unescape(written))
        return match[0] if name is None else f"{head}{quote}{html.escape(name)}{quote}"

    return _FILENAME.sub(attribute, text) if renamed else text
