"""Cameras, rigs, pictures behind cameras, and how a 3D view looks at something."""
