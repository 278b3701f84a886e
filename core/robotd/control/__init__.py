"""The one thread that reads the device and streams setpoints to it."""
