"""Recordings: frames of the control loop and events, as MCAP files."""
