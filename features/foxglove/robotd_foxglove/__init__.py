"""Server for the program Foxglove."""
