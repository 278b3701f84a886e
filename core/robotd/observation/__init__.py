"""Observation of a robot from inside its process: tap and recorder."""
