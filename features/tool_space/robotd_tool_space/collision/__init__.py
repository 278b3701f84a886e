"""Collisions: shapes of links, the scene, distances and swept motions.

``collision_guard``, beside this folder, judges the motions of a robot by it.
"""
