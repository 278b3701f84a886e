"""Errors of rcl, which rclpy raises and does not export.

Works around: ``RCLError`` is a name of rclpy's extension module alone, which was called otherwise
before. Where it is not there, its base class ``RuntimeError`` is caught in its place.
Measured: nothing; once at import.
Upstream: none known.
Ends with: no version yet.
Shown by: tests/ros/test_plain_rclpy.py.
"""

from __future__ import annotations

from rclpy.exceptions import InvalidHandle

__all__ = ["NODE_GONE", "RCLError"]

try:
    from rclpy._rclpy_pybind11 import RCLError
except ImportError:  # another rclpy
    RCLError = RuntimeError

NODE_GONE = InvalidHandle, RCLError
"""Errors of a publisher or a node that was destroyed meanwhile, or whose context has ended."""
