"""Wireframes as Blender's curves and meshes, and back."""
