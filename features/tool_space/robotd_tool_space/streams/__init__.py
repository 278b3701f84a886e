"""Twists of the tool that come one at a time: limits, singularities, and when none comes."""
