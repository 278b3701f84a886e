"""Summary of a run: checks that ran, and reasons of the skipped ones."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

import pytest

from robotd_conformance.checks.inconclusive import is_undecided
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.results import Results

COUNTED = ("passed", "failed", "inconclusive", "skipped")


class Report:
    """Counts checks by capability as pytest reports them, and sums up at the end.

    Args:
        target: of the checks.
        results: file of results, or None.
        progress: print a line for each check.
    """

    def __init__(
        self, target: KitTarget, results: Results | None = None, *, progress: bool = False
    ) -> None:
        self._target, self._results, self._progress = target, results, progress
        self._counts: dict[str, Counter[str]] = {}
        self._reasons: Counter[str] = Counter()
        self._failed: list[str] = []
        self._inconclusive: list[str] = []
        self._interrupted = False
        self._total = self._done = 0
        self._began_s = time.monotonic()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Note how many checks there are."""
        self._total, self._began_s = len(session.items), time.monotonic()

    def pytest_keyboard_interrupt(self) -> None:
        """Note that checks are missing."""
        self._interrupted = True

    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """Leave out pytest's letters where there is a line for each check."""
        if not self._progress or not isinstance(report, pytest.TestReport):
            return None
        outcome = report.outcome if report.when == "call" or not report.passed else ""
        return outcome, "", ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A check counts once: when it was called, or when its set-up ended it."""
        outcome = "inconclusive" if is_undecided(report) else str(report.outcome)
        name = report.nodeid.rpartition("/")[2]
        if report.failed:
            clauses = dict(report.user_properties).get("clauses", "")
            self._failed.append(f"{name}  {clauses}".rstrip())
        if report.when != "call" and (report.when != "setup" or report.passed):
            return
        capability = dict(report.user_properties)["capability"]
        self._counts.setdefault(str(capability), Counter())[outcome] += 1
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
        reason = reason.removeprefix("Skipped: ")
        if outcome == "inconclusive":
            self._inconclusive.append(f"{name}: {reason}")
        elif report.skipped:
            self._reasons[reason] += 1
        self._done += 1
        if self._results is not None:
            self._results.note(report.nodeid, outcome, report.duration)
        if self._progress:
            self._print_progress(name, outcome, report.duration)

    def _print_progress(self, name: str, outcome: str, duration_s: float) -> None:
        passed_s = time.monotonic() - self._began_s
        left_s = passed_s / self._done * (self._total - self._done)
        left = f"{left_s / 60.0:.0f} min" if left_s > 90.0 else f"{left_s:.0f} s"
        line = f"[{self._done:>3}/{self._total}] {outcome:<12} {duration_s:6.1f} s  {name}"
        print(f"{line}  (about {left} left)", flush=True)  # noqa: T201 - the output of the command

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Close the results of a run whose checks have all been decided."""
        whole = self._done >= self._total and not (self._interrupted or session.shouldstop)
        if self._results is not None and whole and not self._inconclusive:
            self._results.complete()

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Print it after the failures."""
        name, robot = self._target.backend.name, self._target.descriptor.name
        terminalreporter.write_sep("=", f"conformance of the {name} backend on {robot}", bold=True)
        for line in self.lines():
            terminalreporter.write_line(line)

    def lines(self) -> Iterator[str]:
        """A table by capability, the share that was tested, reasons of skips, what failed."""
        yield f"{'capability':<18}" + "".join(f"{word:>14}" for word in COUNTED)
        for capability, counts in sorted(self._counts.items()):
            yield f"{capability:<18}" + "".join(f"{counts[word] or '-':>14}" for word in COUNTED)
        totals = sum(self._counts.values(), Counter())
        run = totals["passed"] + totals["failed"]
        share = run / totals.total() if totals else 0.0
        yield ""
        yield f"tested on {share:.0%} of the checks: {run} of {totals.total()}"
        yield f"duration: {time.monotonic() - self._began_s:.0f} s"
        if self._results is not None and self._results.earlier:
            yield f"{len(self._results.earlier)} checks had passed in an earlier run"
        if distance := self._target.pose.summary():
            yield distance
        for reason, count in self._reasons.most_common():
            yield f"  {count} skipped: {reason}"
        yield from (f"INCONCLUSIVE {check}" for check in self._inconclusive)
        yield from (f"FAILED {check}" for check in self._failed)
        yield f"verdict: {self._verdict(run)}"

    def _verdict(self, run: int) -> str:
        if self._failed:
            return f"FAILED, {len(self._failed)} of {run}"
        if self._interrupted:
            return "none, the run was interrupted"
        if self._inconclusive:
            return (
                f"passed, but {len(self._inconclusive)} inconclusive: run them again on a calmer"
                " computer"
            )
        return (
            "passed" if run or (self._results and self._results.earlier) else "nothing was tested"
        )
