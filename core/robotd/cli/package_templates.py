"""Templates of the packages that ``new-backend`` and ``new-robot`` write."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from string import Template

TEMPLATES = Path(__file__).parent / "templates"
SUFFIX = ".in"  # so that no tool treats a template as source code


def write_package(template: str, folder: Path, words: dict[str, str]) -> None:
    """Fill the templates in the folder ``template`` into ``folder``."""
    templates = TEMPLATES / template
    for path in sorted(templates.rglob(f"*{SUFFIX}")):
        relative = path.relative_to(templates).as_posix().removesuffix(SUFFIX)
        target = folder / relative.replace("PACKAGE", words["package"])
        target.parent.mkdir(parents=True, exist_ok=True)
        text = Template(path.read_text(encoding="utf-8")).substitute(words)
        target.write_text(text, encoding="utf-8")


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
