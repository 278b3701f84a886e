"""Conformance kit for backends, and ``robotd new-backend``."""
