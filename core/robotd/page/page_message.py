"""Type of the messages to viewers of a page."""

from __future__ import annotations

Message = str | bytes
"""JSON text, or samples as ``LiveSamples`` makes them."""
