"""Checks of a computer before a robot runs on it."""
