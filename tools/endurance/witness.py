"""Command: random sequences with judges at the drives, thousands of them.

``python -m tools.endurance.witness canopen --seeds 0:1000``; ``feetech --seeds 55:56 --log``
"""

from __future__ import annotations

import argparse
import sys
import time

from tests.witness.backends import BENCHES, run_seed
from tests.witness.draws import FAULTS


def main(arguments: list[str] | None = None) -> int:
    """Run the seeds; return the number of those that failed, at most 1."""
    parser = argparse.ArgumentParser(prog="python -m tools.endurance.witness", description=__doc__)
    parser.add_argument("backends", nargs="*", help=f"of {', '.join(BENCHES)}; none: all")
    parser.add_argument("--seeds", default="0:100", metavar="FIRST:END")
    parser.add_argument("--without", default="", metavar="FAULT,...", help=", ".join(FAULTS))
    parser.add_argument("--log", action="store_true", help="print all commands of each seed")
    options = parser.parse_args(arguments)
    left_out = options.without.split(",")
    faults = {name: weight for name, weight in FAULTS.items() if name not in left_out}
    first, end = (int(part) for part in options.seeds.split(":"))
    failed = 0
    for name in options.backends or BENCHES:
        began_s, found = time.process_time(), 0
        for seed in range(first, end):
            log: list[str] = []
            if text := run_seed(name, seed, faults, log):
                found += 1
            for line in [*(log if options.log else ()), *([text] if text else ())]:
                sys.stdout.write(line + "\n")
            sys.stdout.flush()
        spent_s = time.process_time() - began_s
        sys.stdout.write(f"{name}: {found} of {end - first} seeds failed, {spent_s:.0f} s\n")
        failed += found
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
