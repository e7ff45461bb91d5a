"""Fitting a deformation field to pictures."""
