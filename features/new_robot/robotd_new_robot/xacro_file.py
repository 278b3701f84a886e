"""Expands xacro files by the package ``xacro``, where it is installed."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from robotd.api import DescriptorError
from robotd.api.models import package_folders


def expand_xacro(path: Path, arguments: Mapping[str, str], folders: Sequence[Path]) -> str:
    """Return the URDF of a xacro file, in the lines of the command ``xacro``.

    ``$(find PACKAGE)`` is looked up in ``AMENT_PREFIX_PATH``, beside the file and in ``folders``.

    Args:
        arguments: values of its ``<xacro:arg>``.
        folders: that hold packages.

    Raises DescriptorError: xacro is not installed, or cannot expand the file.
    """
    try:
        xacro: Any = importlib.import_module("xacro")
        substitution: Any = importlib.import_module("xacro.substitution_args")
    except ImportError:
        what = (
            "is xacro: install the package that expands it, 'pip install xacro', and try again;"
            f" or run 'xacro {path.name} > NAME.urdf' and pass the result"
        )
        raise DescriptorError(what, path=path) from None

    def find(package: str) -> str:
        beside = package_folders(package, path)
        for folder in (*beside, *(folder / package for folder in folders)):
            if folder.is_dir():
                return str(folder)
        raise FileNotFoundError(
            f"package {package!r} is neither in AMENT_PREFIX_PATH nor beside the file: pass"
            " --meshes FOLDER, the folder that holds it"
        )

    # xacro's own search needs ROS; it has no option for another one.
    try:
        with patch.object(substitution, "_eval_find", find):
            document = xacro.process_file(str(path), mappings=dict(arguments))
            text: str = document.toprettyxml(indent="  ")
    except Exception as error:  # noqa: BLE001 - its parser, evaluator and macros raise any kind
        cause = getattr(error, "exc", None)  # xacro's texts repeat it
        reason = str(cause if isinstance(cause, OSError) else error) or type(error).__name__
        if "Undefined substitution argument" in reason:
            reason += ": pass --xacro-arg NAME:=VALUE"
        raise DescriptorError(f"xacro cannot expand it: {reason}", path=path) from None
    return text
