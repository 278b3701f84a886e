"""Observation of a robot from inside its process: the tap, and the frames that it keeps."""
