"""Install packages into this environment by uv, or by pip where uv cannot be had.

``python -m tools.install ARGUMENTS``: the arguments of ``pip install``. uv needs a fifth of pip's
processor time for what ``make run`` installs, but does not read pip's settings. They are handed to
it, so that a package mirror is set once, for pip. If uv fails, pip tries the same.
docs/decisions/past.md (0039) has the figures.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec

UV = "uv>=0.8,<1"
OPTIONS = {
    "index-url": "--default-index",
    "extra-index-url": "--index",
    "find-links": "--find-links",
    "constraint": "--constraints",
    "trusted-host": "--allow-insecure-host",
}
"""Settings of pip with a list of values: the option of uv that takes one of them."""
VARIABLES = {
    "cert": "SSL_CERT_FILE",
    "client-cert": "SSL_CLIENT_CERT",
    "proxy": "ALL_PROXY",
    "default-timeout": "UV_HTTP_TIMEOUT",
    "timeout": "UV_HTTP_TIMEOUT",
}
"""Settings of pip with one value: the environment variable that uv reads it from."""

_PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")


def read_pip_settings(listing: str) -> dict[str, str]:
    """Return the settings of ``pip install`` from the output of ``pip config list``.

    Later sections override earlier ones, as in pip: all commands, ``install``, the environment.
    """
    pairs = [line.split("=", 1) for line in listing.splitlines() if "=" in line]
    return {
        name.removeprefix(section): str(ast.literal_eval(value))
        for section in ("global.", "install.", ":env:.")
        for name, value in pairs
        if name.startswith(section)
    }


def uv_command(settings: Mapping[str, str], arguments: Sequence[str]) -> list[str]:
    """Return the command of uv that installs from where pip would with these settings."""
    command = [sys.executable, "-m", "uv", "pip", "install", "--quiet", "--python", sys.executable]
    command += ["--index-strategy", "unsafe-best-match"]  # as pip: the best version of all indexes
    if settings.get("no-index", "no").lower() in {"1", "true", "yes", "on"}:
        command.append("--no-index")
    for name, option in OPTIONS.items():
        for value in settings.get(name, "").split():
            command += [option, value]
    return [*command, *arguments]


def uv_environment(settings: Mapping[str, str]) -> dict[str, str]:
    """Return the environment variables of uv that stand for these settings of pip."""
    return {variable: settings[name] for name, variable in VARIABLES.items() if name in settings}


def has_uv() -> bool:
    """Install uv if it is missing; return whether it is there."""
    return find_spec("uv") is not None or subprocess.call([*_PIP, "install", "--quiet", UV]) == 0


def install(arguments: Sequence[str]) -> int:
    """Install by uv, else by pip; return the exit status."""
    if has_uv():
        listing = subprocess.check_output([*_PIP, "config", "list"], text=True)
        settings = read_pip_settings(listing)
        environment = os.environ | uv_environment(settings)
        if subprocess.call(uv_command(settings, arguments), env=environment) == 0:
            return 0
    print("robotd: no uv, or it failed: pip installs, which takes longer", file=sys.stderr)
    # Modules are compiled when they are first imported: all of them would take a third of the time.
    environment = os.environ | {"PIP_NO_COMPILE": "1"}
    return subprocess.call([*_PIP, "install", "--quiet", *arguments], env=environment)


if __name__ == "__main__":
    try:
        sys.exit(install(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
