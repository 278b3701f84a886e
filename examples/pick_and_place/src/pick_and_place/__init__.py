"""Carries parts from one place to another."""
