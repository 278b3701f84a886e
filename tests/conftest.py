"""Settings of Hypothesis for all tests."""

from __future__ import annotations

from hypothesis import settings

# No deadlines: a busy computer misses every one. Examples are the same in every run, so that a
# change is judged by itself; ``--hypothesis-profile=explore`` looks for new ones.
settings.register_profile("explore", deadline=None)
settings.register_profile("robotd", settings.get_profile("explore"), derandomize=True)
settings.load_profile("robotd")
