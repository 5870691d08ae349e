"""Observations: the robot's cameras, their images, point clouds and masks."""
