"""Prints without a robot: struts that are laid, sag, miss and fall, and pictures of what stands."""
