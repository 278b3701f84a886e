"""Motions of the tool: segments, their corners, the joints along them, and their times.

Planned in the thread of the caller, before anything moves.
"""
