"""First switch-on of a real axis: steps, findings, and what they change in the descriptor."""
