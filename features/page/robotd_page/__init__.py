"""Live page of a robot, served from inside its process; needs aiohttp."""
