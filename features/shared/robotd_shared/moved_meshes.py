"""Names of meshes in the text of a URDF that is written to another place."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping
from pathlib import Path

from robotd.api import find_mesh

_FILENAME = re.compile(r"""(<mesh\b[^>]*?\bfilename\s*=\s*)(["'])(.*?)\2""")


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
