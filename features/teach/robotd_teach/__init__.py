"""What a person teaches a robot: poses by name, and programs of steps."""
