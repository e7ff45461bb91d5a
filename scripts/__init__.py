"""Run by developers, or by ``blender --background --python``."""
