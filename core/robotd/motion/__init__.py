"""Pure functions on trajectories, limits, tolerances and kinematics."""
