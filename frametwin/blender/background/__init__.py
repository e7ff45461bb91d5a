"""Jobs beside Blender: processes, their steps, and the folders they write."""
