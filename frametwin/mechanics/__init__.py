"""Frames as beams: stiffness, hardening, sag and other deformations, with finite rotations."""
