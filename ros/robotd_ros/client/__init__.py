"""Clients of a running robot, used by the command line."""
