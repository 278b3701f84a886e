"""Teaching: poses by name, paths, and programs of steps."""
