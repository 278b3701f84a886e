"""Motions of many segments: planned as one, run with waits and outputs, appended to, joined."""
