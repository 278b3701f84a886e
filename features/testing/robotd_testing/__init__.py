"""Test tools for plugin authors, users and the project's own tests."""
