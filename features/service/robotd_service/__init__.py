"""A robot under a supervisor: systemd notifications, health port, unit file."""
