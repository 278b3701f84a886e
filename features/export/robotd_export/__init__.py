"""Client configuration (MoveIt 2, Nav2, Isaac Sim, URDF) from a robot's descriptor."""
