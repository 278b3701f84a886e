"""Templates of the packages that ``new-backend`` and ``new-robot`` write."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from string import Template

from robotd.errors import OperationError

SUFFIX = ".in"  # so that no tool treats a template as source code


def write_package(templates: Path, folder: Path, words: dict[str, str]) -> None:
    """Fill the templates in the folder ``templates`` into ``folder``. Raises OperationError."""
    files = dict[str, bytes]()
    for path in sorted(templates.rglob(f"*{SUFFIX}")):
        name = path.relative_to(templates).as_posix().removesuffix(SUFFIX)
        text = Template(path.read_text(encoding="utf-8")).substitute(words)
        files[name.replace("PACKAGE", words["package"])] = text.encode()
    write_files(folder, files)


def write_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files by their paths in ``folder``. Raises OperationError, naming the path."""
    try:
        for name, content in files.items():
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
    except OSError as error:
        raise OperationError(f"{error.filename}: {error.strerror}") from error


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
