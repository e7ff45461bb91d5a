"""Pictures: masks out of photographs, multi-layer EXR, overlays and contact sheets."""
