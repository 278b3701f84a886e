"""Kinematics of an arm: frames of its links, Jacobians and inverse kinematics.

Pure computation on arrays; any thread.
"""
