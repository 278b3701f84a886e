"""Commands that list what is installed: robots, backends, features, nodes."""
