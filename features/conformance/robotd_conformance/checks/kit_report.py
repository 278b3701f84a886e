"""Summary of a run: checks that ran, and reasons of the skipped ones."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence

import pytest
from _pytest.junitxml import xml_key

from robotd_conformance.checks import clauses
from robotd_conformance.checks.inconclusive import is_refused, is_undecided
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.known_faults import likely_faults
from robotd_conformance.checks.results import Results

COUNTED = ("passed", "failed", "inconclusive", "skipped")


class KitReport:
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
        self._failed: dict[str, list[str]] = {}  # and the clauses that each is about
        self._inconclusive: list[str] = []  # those that were refused included
        self._refused = 0
        self._interrupted = False
        self._total = self._done = self._left_out = 0
        self._began_s = time.monotonic()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Note how many checks there are."""
        self._total, self._began_s = len(session.items), time.monotonic()

    def pytest_deselected(self, items: Sequence[pytest.Item]) -> None:
        """Count what ``--quick``, ``-k`` or an earlier run has left out."""
        self._left_out += len(items)

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
        undecided = is_undecided(report) or is_refused(report)
        outcome = "inconclusive" if undecided else str(report.outcome)
        name = report.nodeid.rpartition("/")[2]
        if report.failed:
            self._failed[name] = str(dict(report.user_properties).get("clauses", "")).split()
        if report.when != "call" and (report.when != "setup" or report.passed):
            return
        capability = dict(report.user_properties)["capability"]
        self._counts.setdefault(str(capability), Counter())[outcome] += 1
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
        reason = reason.removeprefix("Skipped: ")
        if outcome == "inconclusive":
            self._inconclusive.append(f"{name}: {reason}")
            self._refused += is_refused(report)
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

    @pytest.hookimpl(tryfirst=True)  # the JUnit file is written by a later one
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Close the results of a run whose checks have all been decided; mark others in JUnit."""
        whole = self._done >= self._total and not (self._interrupted or session.shouldstop)
        xml = session.config.stash.get(xml_key, None)
        if xml is not None and not whole:
            text = f"the run ended early: {self._done} of {self._total} checks were executed"
            where = ("robotd conform", None, "robotd conform")
            error = pytest.TestReport("robotd conform", where, {}, "failed", text, "setup")
            xml.pytest_runtest_logreport(error)
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
        total = max(self._total, totals.total())
        share = run / total if total else 0.0
        yield ""
        yield f"tested on {share:.0%} of the checks: {run} of {total}"
        if absent := total - totals.total():
            yield f"{absent} checks were not executed"
        earlier = len(self._results.earlier) if self._results is not None else 0
        if self._left_out > earlier:
            yield f"{self._left_out - earlier} further checks were not selected"
        yield f"duration: {time.monotonic() - self._began_s:.0f} s"
        if earlier:
            yield f"{earlier} checks had passed in an earlier run"
        if distance := self._target.pose.summary():
            yield distance
        for reason, count in self._reasons.most_common():
            yield f"  {count} skipped: {reason}"
        yield from (f"INCONCLUSIVE {check}" for check in self._inconclusive)
        for check, names in self._failed.items():
            yield f"FAILED {check}"
            yield from _explained(check, names)
        yield f"verdict: {self._verdict(run)}"

    def _verdict(self, run: int) -> str:
        if self._failed:
            return f"FAILED, {len(self._failed)} of {run}"
        if self._interrupted:
            return "none, the run was interrupted"
        if self._refused and not run:
            return f"none, the kit refused {self._refused} checks"
        if self._inconclusive:
            return f"passed, but {len(self._inconclusive)} inconclusive: {self._remedy()}"
        return (
            "passed" if run or (self._results and self._results.earlier) else "nothing was tested"
        )

    def _remedy(self) -> str:
        """Return what makes the inconclusive checks conclusive."""
        busy = len(self._inconclusive) - self._refused
        wanted = ["run them again on a calmer computer"] if busy else []
        wanted += ["give the axes more room"] if self._refused else []
        return ", ".join(wanted)


def _explained(check: str, names: Sequence[str]) -> Iterator[str]:
    """Yield the clauses that a check is about, and faults that it has found elsewhere."""
    contract, _, _ = clauses.load()
    yield from (f"  {name}: {contract[name].says}" for name in names if name in contract)
    if faults := likely_faults(check):
        yield f"  faults that it has found: {'; '.join(faults)}"
