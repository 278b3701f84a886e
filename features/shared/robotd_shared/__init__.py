"""Modules that several features use, and the core does not: each has one subject."""
