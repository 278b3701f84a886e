"""Device contracts: what a backend fills and what the core checks around it."""
