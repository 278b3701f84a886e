"""Workarounds and fast paths around rclpy and the DDS, each with its measurement."""
