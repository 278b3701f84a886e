"""What every test of the ROS nodes needs."""

from __future__ import annotations

import warnings

# The first message type to be used imports an old lark, which imports deprecated modules.
# Imported here, it cannot turn the first test into an error.
with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401
