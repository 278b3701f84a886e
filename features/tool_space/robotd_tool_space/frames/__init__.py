"""Tool frames and work frames: chosen, followed while they move, calibrated by touching."""
