"""Backend plugins: the hooks, their discovery and validation."""
