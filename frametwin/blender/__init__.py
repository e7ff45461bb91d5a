"""Blender adapters: between FrameTwin's own types and Blender's data. Needs ``bpy``, and numpy alone beside it."""
