"""Sensors: poses of bodies and cameras to colour, depth, world positions and ids, by our own rasteriser.

No graphics driver, no GPU, no fast-math: the same pixels everywhere (docs/architecture.md says where).
"""
