"""Simulation backend."""
