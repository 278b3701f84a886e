"""Robot descriptors that ship with robotd, one folder per robot."""
