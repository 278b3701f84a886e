"""The commands of robotd."""
