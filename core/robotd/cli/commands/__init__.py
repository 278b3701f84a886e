"""The commands of robotd, one module per command."""
