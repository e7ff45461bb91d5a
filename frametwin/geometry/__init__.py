"""Frames and curves: wireframes and their checks, Bezier curves, rotation-minimising frames, parametric frames."""
