"""``pick-and-place``: one part from left to right."""

from __future__ import annotations

import sys

from pick_and_place.arm import Arm, ArmFailed
from pick_and_place.carry import LEFT, RIGHT, carry


def main() -> int:
    """Carry one part; the exit status."""
    try:
        with Arm() as arm:
            carry(arm, LEFT, RIGHT)
    except ArmFailed as error:
        print(f"pick-and-place: {error}", file=sys.stderr)  # noqa: T201 - what people see
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
