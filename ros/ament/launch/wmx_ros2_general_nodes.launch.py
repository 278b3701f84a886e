"""The four service nodes of the vendor's launch file of this name, in one process."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # launch loads this file by its path

from robot_process import service_nodes as generate_launch_description

__all__ = ["generate_launch_description"]
