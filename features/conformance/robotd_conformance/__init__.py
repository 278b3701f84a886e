"""Conformance kit for backends, ``robotd new-backend`` and ``robotd new-plugin``."""
