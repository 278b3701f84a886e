"""Summary of a run: checks that ran, and reasons of the skipped ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import pytest

from robotd_conformance.checks.kit_target import KitTarget

COUNTED = ("passed", "failed", "skipped")


class Report:
    """Counts checks by capability as pytest reports them, and sums up at the end.

    Args:
        target: of the checks.
    """

    def __init__(self, target: KitTarget) -> None:
        self._target = target
        self._counts: dict[str, Counter[str]] = {}
        self._reasons: Counter[str] = Counter()
        self._failed: list[str] = []
        self._interrupted = False

    def pytest_keyboard_interrupt(self) -> None:
        """Note that checks are missing."""
        self._interrupted = True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A check counts once: when it was called, or when its set-up ended it."""
        if report.failed:
            self._failed.append(report.nodeid.rpartition("/")[2])
        if report.when != "call" and (report.when != "setup" or report.passed):
            return
        capability = dict(report.user_properties)["capability"]
        self._counts.setdefault(str(capability), Counter())[report.outcome] += 1
        if report.skipped and isinstance(report.longrepr, tuple):
            self._reasons[report.longrepr[2].removeprefix("Skipped: ")] += 1

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print it after the failures."""
        name, robot = self._target.backend.name, self._target.descriptor.name
        terminalreporter.write_sep("=", f"conformance of the {name} backend on {robot}", bold=True)
        for line in self.lines():
            terminalreporter.write_line(line)

    def lines(self) -> Iterator[str]:
        """A table by capability, the share that was tested, reasons of skips, what failed."""
        yield f"{'capability':<18}" + "".join(f"{word:>9}" for word in COUNTED)
        for capability, counts in sorted(self._counts.items()):
            yield f"{capability:<18}" + "".join(f"{counts[word] or '-':>9}" for word in COUNTED)
        totals = sum(self._counts.values(), Counter())
        run = totals["passed"] + totals["failed"]
        share = run / totals.total() if totals else 0.0
        yield ""
        yield f"tested on {share:.0%} of the checks: {run} of {totals.total()}"
        if distance := self._target.pose.summary():
            yield distance
        for reason, count in self._reasons.most_common():
            yield f"  {count} skipped: {reason}"
        yield from (f"FAILED {check}" for check in self._failed)
        verdict = "passed" if run else "nothing was tested"
        if self._interrupted:
            verdict = "none, the run was interrupted"
        yield f"verdict: {f'FAILED, {len(self._failed)} of {run}' if self._failed else verdict}"
