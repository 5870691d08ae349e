"""Rotations, poses, triangle meshes and convex hulls: pure array code, no engine, no state.

Quaternions are (w, x, y, z) and unit length everywhere in ArtiSkill. Lengths are metres, angles radians.
"""
