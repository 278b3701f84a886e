"""Mesh files of a URDF that the server of the page may read."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlparse

from lxml import etree

from robotd.descriptor.files import is_file
from robotd.log import get_logger

log = get_logger("page")

SUFFIXES = (".stl", ".dae")
MAX_BYTES = 64 * 2**20


def mesh_files(urdf: str, path: Path | None) -> dict[str, Path]:
    """Return the file of each visual mesh, by its name in the URDF.

    A mesh that is not found or has another format is logged and left out.

    Args:
        urdf: text of the URDF; "" for none.
        path: file of the URDF, which relative names start from.
    """
    found: dict[str, Path] = {}
    for name in _names(urdf):
        file = next(filter(is_file, _places(name, path)), None)
        if file is None:
            log.warning("mesh not found: the link is not drawn", mesh=name)
        elif file.suffix.lower() not in SUFFIXES or file.stat().st_size > MAX_BYTES:
            log.warning("mesh not drawn: STL or DAE up to 64 MiB are", mesh=name)
        else:
            found[name] = file
    return found


def _names(urdf: str) -> list[str]:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    try:
        root = etree.fromstring(urdf.encode(), parser) if urdf else None
    except etree.XMLSyntaxError:
        return []
    meshes = [] if root is None else root.findall(".//visual/geometry/mesh")
    return list(dict.fromkeys(mesh.get("filename", "") for mesh in meshes))


def _places(name: str, path: Path | None) -> Iterator[Path]:
    """Yield the files that a name may mean, the most likely first."""
    url = urlparse(name)
    location = unquote(url.path)
    if url.scheme == "package":
        inside = location.lstrip("/")
        for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
            yield Path(prefix, "share", url.netloc, inside)
        for folder in path.absolute().parents if path else ():
            if folder.name == url.netloc:
                yield folder / inside
            yield folder / url.netloc / inside
    elif url.scheme in ("", "file") and path:
        yield path.absolute().parent / location
