"""The fuzzer reports a worker that reads nothing."""

from __future__ import annotations

import pytest
from tools.fuzz import campaign


def test_a_worker_that_reads_nothing_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "HANG_S", 0.2)
    with pytest.raises(RuntimeError, match=r"no reader of \['nobody'\] got an input: hangs"):
        next(campaign.run(seed=1, seconds=20.0, names=["nobody"]))
