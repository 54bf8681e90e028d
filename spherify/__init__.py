"""Spherify: triangle meshes morphed into round spheres by Vartziotis's curvature transformation."""

__version__ = "0.1.0"
