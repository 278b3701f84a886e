"""Writes ``known_faults.json``: what each check finds in mutants, and the quick choice of checks.

``robotd conform --backend sim --robot cr3a --resume FILE`` measures the durations, and
``python -m tests.features.conformance.runs.measured_faults FILE`` writes the choice. Without FILE
the choice stays, and only the faults are renewed.
"""

from __future__ import annotations

import json
import re
import sys
from collections import defaultdict
from pathlib import Path

from tests.features.conformance.runs.mutants import all_mutants
from tests.features.conformance.runs.mutants.plugin import Mutant

from robotd_conformance.checks import known_faults

QUICK_S = 16.0  # of all checks, without the start of the program
LEAST_S = 0.02  # of a check, with its report
CAPITAL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def checks_of(mutant: type[Mutant]) -> tuple[str, ...]:
    """Return the checks that find a mutant."""
    names = mutant.found_by
    return tuple(filter(None, (names,) if isinstance(names, str) else names))


def text_of(mutant: type[Mutant]) -> str:
    """Return the fault of a mutant in words: its name, and the first line of its own docstring."""
    name = CAPITAL.sub(" ", mutant.__name__).lower()
    own = (vars(mutant).get("__doc__") or "").strip().partition("\n")[0].rstrip(".")
    return f"{name} ({own[:1].lower()}{own[1:]})" if own else name


def found_faults() -> dict[str, list[str]]:
    """Return the faults that each check finds."""
    found = defaultdict[str, list[str]](list)
    for mutant in all_mutants().values():
        for check in checks_of(mutant):
            found[check].append(text_of(mutant))
    return {check: sorted(texts) for check, texts in sorted(found.items())}


def choose(durations_s: dict[str, float]) -> list[str]:
    """Return checks that find many mutants in ``QUICK_S``: the one with most per second first."""
    finds = defaultdict[str, set[str]](set)
    for name, mutant in all_mutants().items():
        for check in checks_of(mutant):
            finds[check].add(name)
    chosen, found, left_s = list[str](), set[str](), QUICK_S
    while True:
        able = [
            mutant
            for mutant in sorted(finds.keys() & durations_s.keys() - set(chosen))
            if finds[mutant] - found and durations_s[mutant] <= left_s
        ]
        if not able:
            print(f"{len(chosen)} checks find {len(found)} of {len(all_mutants())} mutants")  # noqa: T201
            return sorted(chosen)
        best = max(able, key=lambda mutant: len(finds[mutant] - found) / durations_s[mutant])
        chosen.append(best)
        found |= finds[best]
        left_s -= durations_s[best]


def durations(results: Path) -> dict[str, float]:
    """Return the duration of each check, all its parameters together."""
    total_s = defaultdict[str, float](float)
    for line in map(json.loads, results.read_text(encoding="utf-8").splitlines()):
        if "check" in line:
            total_s[line["check"].partition("[")[0]] += max(line["duration_s"], LEAST_S)
    return dict(total_s)


def main() -> None:
    """Write the file."""
    before = json.loads(known_faults.PATH.read_text()) if known_faults.PATH.exists() else {}
    quick = choose(durations(Path(sys.argv[1]))) if sys.argv[1:] else before["quick"]
    content = {"quick": quick, "found": found_faults()}
    known_faults.PATH.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
