"""Publisher of /diagnostics."""
