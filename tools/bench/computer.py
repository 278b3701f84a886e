"""Cost that every program pays on this computer: compiles and runs computer.c.

``python -m tools.bench.computer`` prints it.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from pathlib import Path

SOURCE = Path(__file__).with_suffix(".c")


def computer() -> dict[str, float]:
    """Return the medians of computer.c by name; empty without a C compiler.

    ``wake_up_us``: processor time of a sleep of 2 ms; ``wake_up_late_us``: how late it ends;
    ``memory_ns``: a load from memory that no cache holds.
    """
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return {}
    with tempfile.TemporaryDirectory(prefix="robotd-bench-") as folder:
        program = str(Path(folder, "computer"))
        subprocess.run([compiler, "-std=gnu11", "-O2", str(SOURCE), "-o", program], check=True)
        figures: dict[str, float] = json.loads(subprocess.check_output([program]))
    return figures


if __name__ == "__main__":
    print(json.dumps(computer()))
