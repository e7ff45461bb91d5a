"""Masks, passes and photographs of a scene file, by Workbench, Cycles or EEVEE."""
