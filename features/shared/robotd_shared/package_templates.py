"""Templates of the packages that ``new-plugin``, ``new-backend`` and ``new-robot`` write."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from string import Template

from robotd.api import RobotdError

SUFFIX = ".in"  # so that no tool treats a template as source code


def package_files(templates: Path, words: Mapping[str, str]) -> dict[str, bytes]:
    """Return the files of a package by their paths: the filled templates of a folder."""
    files = dict[str, bytes]()
    for path in sorted(templates.rglob(f"*{SUFFIX}")):
        name = path.relative_to(templates).as_posix().removesuffix(SUFFIX)
        text = Template(path.read_text(encoding="utf-8")).substitute(words)
        name = name.replace("PACKAGE", words["package"]).replace("NAME", words["name"])
        files[name] = text.encode()
    return files


def write_folder(folder: Path, files: Mapping[str, bytes | Path]) -> None:
    """Make a folder with files: all of them, or nothing.

    Args:
        folder: must not exist; its parents are made.
        files: contents, or files to copy, by their paths in the folder.

    Raises RobotdError: the folder exists, or cannot be written; it names the reason.
    """
    if folder.exists():
        raise RobotdError(f"folder {folder} exists already")
    made = next((path for path in [folder, *folder.parents][::-1] if not path.exists()), folder)
    unfinished = folder.with_name(f".{folder.name}.unfinished-{os.getpid()}")
    try:
        for name, content in files.items():
            target = unfinished / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, Path):
                shutil.copyfile(content, target)
            else:
                target.write_bytes(content)
        unfinished.rename(folder)
    except OSError as error:
        shutil.rmtree(unfinished if made == folder else made, ignore_errors=True)
        what = f"folder {folder} cannot be written, nothing is left of it: {error.strerror}"
        raise RobotdError(what) from error


def package_words(name: str) -> dict[str, str]:
    """Return the words of a package called ``name``, for the templates."""
    lower = name.lower()
    return {
        "name": name,
        "package": f"robotd_{lower}",
        "distribution": f"robotd-{lower.replace('_', '-')}",
        "Name": "".join(word.capitalize() for word in name.split("_")),
        "robotd_version": ".".join(version("robotd").split(".")[:2]),
    }
