"""How soon other processes find this one.

Fast DDS answers a new process once, and in one case out of three before that process listens. It
then hears of us with our next periodic announcement, by default after up to 3 s (measured from a
client's start to its first service: 0.08 s in two cases of three, else up to 2.7 s). Announcing
every 0.2 s ends that wait for every client.
"""

from __future__ import annotations

import os
from pathlib import Path

PROFILES = Path(__file__).with_name("fastdds.xml")

# Where Fast DDS looks for profiles of the user, which are never replaced.
_VARIABLES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
_FILE_HERE = "DEFAULT_FASTRTPS_PROFILES.xml"


def announce_often() -> None:
    """Call before ROS starts; does nothing where the user has own profiles.

    Other middlewares never read what this sets.
    """
    if any(os.environ.get(name) for name in _VARIABLES) or Path(_FILE_HERE).exists():
        return
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(PROFILES)
