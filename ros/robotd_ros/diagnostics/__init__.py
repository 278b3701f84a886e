"""Health of a robot, part by part, and its publisher on /diagnostics."""
