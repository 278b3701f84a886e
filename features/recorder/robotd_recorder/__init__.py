"""Flight recorder, continuous recording, and their explanation."""
